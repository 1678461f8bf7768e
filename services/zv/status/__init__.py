"""Display of nodes by ``zv up`` and ``zv top``: rows, live tables, CPU and memory of processes."""
