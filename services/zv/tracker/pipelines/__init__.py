"""Tracking pipelines: turn frames, as arrays, into objects and masks; independent of settings."""
