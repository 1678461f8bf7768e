"""``zv top``: the live table of ``zv up`` for any system, the nodes in the worst state first."""
