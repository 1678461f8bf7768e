"""The edge detector: publishes an edge map of each frame."""
