"""Measures edge detectors against what people draw, how steady they are, and how fast."""
