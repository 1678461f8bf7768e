"""Measures speed as ratios to a minimum that is measured in the same run."""
