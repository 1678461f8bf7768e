"""Names of message types as people write them."""

from __future__ import annotations

from zenoh_vision.error_text import did_you_mean, similar_names
from zenoh_vision.errors import ConfigurationError
from zenoh_vision.keys import schema_name_of
from zenoh_vision.message_codec import Message
from zenoh_vision.messages import MESSAGES


def type_of(encoding: str) -> str:
    """Return the type of a Zenoh encoding in one word: ``Centroid``, ``JPEG``, or else ``-``."""
    if schema_name := schema_name_of(encoding):
        chunks = schema_name.split(".")
        return chunks[-2] if len(chunks) > 1 else schema_name
    kind, _, form = encoding.partition("/")
    return form.upper() if kind == "image" else "-"


def message_named(name: str) -> type[Message]:
    """Return a message's class by its short or versioned name, in any case.

    Raises:
        ConfigurationError: There is none; the text has the names that exist.
    """
    for message in MESSAGES.values():
        if name.lower() in (message.short_name().lower(), message.schema_name.lower()):
            return message
    known = sorted(message.short_name() for message in MESSAGES.values())
    hint = did_you_mean(similar_names(name, known), after=" ")
    raise ConfigurationError(f"no message {name!r}: {hint}there are {', '.join(known)}")
