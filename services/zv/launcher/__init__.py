"""``zv up``: runs a whole system from one launch file, each node in a process of its own."""
