"""``zv snapshot``: save the newest picture of a key."""
