"""Measures the viewer: its cost for many clients and nodes, and the time to a painted pixel."""
