"""Recordings for ROS 2: every message in CDR, with the definitions that ``ros2 bag`` needs.

``ros2 bag`` reads a file only if all of its channels have the same encoding. What has no message of
ROS is therefore left out, and the accounts of losses are metadata.
"""
