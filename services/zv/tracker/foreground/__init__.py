"""Foreground of a fixed camera: which pixels of a frame do not belong to the learned background."""
