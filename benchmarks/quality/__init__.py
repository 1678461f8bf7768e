"""Measures the quality of results against ground truth, beside baselines in the same run."""
