"""Camera calibration: maps pixels to a plane in the world. Imports neither Zenoh nor settings.

- ``camera_model``: the lens; removes its distortion from points.
- ``plane``: the homography from undistorted pixels to a plane in the world, and its estimation.
- ``plane_view``: lens and homography together: positions on the plane of pixels, and back.
- ``calibration``: the calibration of one camera, and its message ``CameraInfo``.
- ``ros_yaml``: the calibration file, in the format of ROS' camera_info_manager.

Coordinates are full-resolution pixels; (0, 0) is the centre of the top left pixel, as in OpenCV.
"""
