"""``zv metrics``: serves the health of a whole namespace to Prometheus."""
