"""``zv param``: read, set, save and load the parameters of nodes that run."""
