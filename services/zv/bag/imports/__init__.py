"""Makes records of what other programs wrote: videos, images, recordings of ROS."""
