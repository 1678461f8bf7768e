"""``zv node``: lists the running nodes and shows their descriptions."""
