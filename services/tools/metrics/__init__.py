"""``zv metrics``: the health of a whole namespace, as Prometheus reads it."""
