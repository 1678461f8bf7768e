"""``zv new``: writes the files of a service of your own, to start from."""
