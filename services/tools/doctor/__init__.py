"""``zv doctor``: what is wrong with a system and this machine, and what to do about it."""
