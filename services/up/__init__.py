"""``zv up``: a whole system from one file, each node in a process of its own."""
