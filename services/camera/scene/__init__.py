"""A made-up scene for the synthetic camera: a room, things that move in it, and the truth.

Frame k depends on the scene's parameters and k alone, so it can be made again anywhere.
Nothing in here knows Zenoh, settings or clocks.

``scene``      the whole: picture and truth of frame k
``backdrop``   the empty room
``cast``       who appears, how large, in which colours, on which way
``itinerary``  a closed-form way through the picture: where at which time
``figures``    what each kind of thing looks like in each pose
``sprite``     drawing, clipping and pasting of one small picture
``noise``      sensor noise
``numbering``  a frame's number as coloured blocks, drawn and read
``faults``     faults on demand
"""
