"""``zv schema``: the JSON Schema of a message, from its class; needs no network."""
