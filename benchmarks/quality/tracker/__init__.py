"""Measures the tracker: tracks, the centroid, counts on a belt, all against ground truth."""
