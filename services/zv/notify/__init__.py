"""``zv notify``: sends events with their picture to a webhook and to an MQTT broker."""
