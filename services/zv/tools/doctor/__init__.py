"""``zv doctor``: finds problems of a system and this machine, and suggests remedies."""
