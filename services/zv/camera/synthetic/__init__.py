"""Draws the scene of the synthetic camera, a room with moving objects, with its ground truth.

Frame k depends only on the scene's parameters and on k, so any process can draw it again. This
package uses neither Zenoh nor settings nor clocks.

``source``     the scene as a source of pictures, with faults on demand
``scene``      picture, distances and ground truth of frame k
``backdrop``   the empty room
``actors``     kind, size, colours and path of each object
``figures``    the look of each kind of object in each pose
``sprite``     draws, clips and pastes the small picture of an object
``noise``      sensor noise
``frame_code`` a frame's number as coloured blocks
``faults``     faults on demand
"""
