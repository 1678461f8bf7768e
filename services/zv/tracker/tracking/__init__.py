"""Tracks objects through frames: arithmetic on boxes, pixels and stamps, no network or clock."""
