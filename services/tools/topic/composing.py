"""Which data a key takes: a message of its type, or a picture."""

from __future__ import annotations

from typing import Protocol

from common.errors import ConfigurationError
from common.keys import TOPICS
from common.near_names import nearest, question
from common.publishing import Sample
from services.tools.topic.given_data import bytes_of
from services.tools.topic.message_data import PlainMessage, message_data
from services.tools.topic.picture_data import picture_data
from services.tools.types import MESSAGES, message_named, schema_of, topic_of


class Composer(Protocol):
    """Makes sample after sample."""

    size: tuple[int, int] | None
    """Width and height of the frame, for the header."""

    def make(self, seq: int, epoch: int) -> Sample:
        """Return the next sample, under a header of this moment."""


def needs_size(composer: Composer) -> bool:
    """Tell whether the frame size is unknown and wanted."""
    return composer.size is None and not isinstance(composer, PlainMessage)


def composer_of(key: str, data: str, type_name: str | None) -> Composer:
    """Return what makes samples for a key.

    Args:
        key: Full key.
        data: JSON, the name of a file, or ``-`` for standard input.
        type_name: Message type, for a key that is not in the topic table.

    Raises:
        ConfigurationError: The key has no type, or the data is not as its type says.
        SourceError: The file cannot be read.
    """
    topic = topic_of(key)
    message = None if type_name is None else message_named(type_name)
    if message is None and topic is not None:
        message = MESSAGES.get(schema_of(topic.encoding))
    if message is not None:
        return message_data(key, message, data)
    if topic is None:
        suffixes = sorted(topic.suffix for topic in TOPICS.values())
        near = nearest(key.split("/", 2)[-1], suffixes)
        hint = question([f".../{each}" for each in near], after=" If not, ")
        raise ConfigurationError(
            f"{key} is not in the topic table, so its type is unknown: {hint}"
            f"name one with --type, or take one of .../{', .../'.join(suffixes)}"
        )
    return picture_data(key, topic, bytes_of(data))
