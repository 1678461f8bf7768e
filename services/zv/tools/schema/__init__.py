"""``zv schema``: the JSON Schemas of messages."""
