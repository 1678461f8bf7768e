"""The tracker: the largest moving object of each frame."""
