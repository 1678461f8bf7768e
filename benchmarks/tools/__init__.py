"""Measures the tools: what they cost beside the least that a program can do."""
