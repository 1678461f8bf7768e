"""``zv top``: the live table of ``zv up`` for any system, sorted by what hurts."""
