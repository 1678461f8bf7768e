"""Discovers nodes, streams, health and parameters, and keeps their state."""
