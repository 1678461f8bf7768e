"""Measures edge detectors: scores against boundaries drawn by people, flicker, and speed."""
