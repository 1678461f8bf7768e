"""``zv param``: read, set, save and load the parameters of running nodes."""
