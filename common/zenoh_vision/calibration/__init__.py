"""Camera calibration: from pixels to the world on a plane. Imports neither Zenoh nor settings.

- ``camera_model``: the lens; removes its distortion from points.
- ``plane``: the homography from undistorted pixels to a plane in the world, and how it is found.
- ``plane_view``: both together: positions, velocities and their uncertainty.
- ``calibration``: the calibration of one camera, and its message ``CameraInfo``.
- ``ros_yaml``: its file, which ROS' camera_info_manager reads and writes too.

Pixels are full-resolution ones; (0, 0) is the centre of the top left pixel, as in OpenCV.
"""
