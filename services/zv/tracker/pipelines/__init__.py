"""Tracking pipelines: from frames as arrays to objects and masks, independent of settings."""
