"""The edge detector: an edge map of each frame."""
