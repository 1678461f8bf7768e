"""``zv topic``: list, print, measure and publish data on key expressions."""
