"""``zv node``: which nodes run, and what each says of itself."""
