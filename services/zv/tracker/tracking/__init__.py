"""Tracks from detections: pure arithmetic on boxes, pixels and stamps, without network or clock."""
