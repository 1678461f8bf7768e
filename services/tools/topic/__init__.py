"""``zv topic``: look at what flows on key expressions, measure it, send something."""
