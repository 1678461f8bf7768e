"""Messages to send: from JSON, checked against their type."""

from __future__ import annotations

from typing import Any

from common.codec import Message
from common.errors import ConfigurationError, PayloadError
from common.keys import msgpack_of
from common.messages import Stamped
from common.publishing import Sample
from services.tools.topic.given_data import json_of, tuples
from services.tools.topic.headers import given_header, new_header


class PlainMessage:
    """A message without a header.

    Args:
        message: Checked.
    """

    def __init__(self, message: Message) -> None:
        self.size: tuple[int, int] | None = None
        self._sample = Sample(message.to_bytes(), msgpack_of(message.schema_name), None)

    def make(self, seq: int, epoch: int) -> Sample:  # noqa: ARG002 - it has no header
        """Return the message."""
        return self._sample


class StampedMessage:
    """A message with a header.

    Args:
        message: Its class.
        fields: Of the message, without the header.
        camera: Of the key.
        size: Width and height of the frame, if they were given.
    """

    def __init__(
        self,
        message: type[Message],
        fields: dict[str, Any],
        camera: str,
        size: tuple[int, int] | None,
    ) -> None:
        self.size = size
        self._message = message
        self._fields = fields
        self._camera = camera

    def make(self, seq: int, epoch: int) -> Sample:
        """Return the message with a new header.

        Raises:
            ConfigurationError: It is not as its type says.
        """
        header = new_header(self._camera, epoch, seq, self.size or (1, 1), None)
        try:
            message = self._message.from_map({**self._fields, "header": header.to_map()})
        except PayloadError as error:
            fields = ", ".join(name for name in self._message.model_fields if name != "header")
            raise ConfigurationError(f"{error.detail}; its fields: {fields}") from None
        encoding = msgpack_of(self._message.schema_name)
        return Sample(message.to_bytes(), encoding, header.to_bytes())


def message_data(key: str, message: type[Message], data: str) -> PlainMessage | StampedMessage:
    """Return what sends a message.

    Raises:
        ConfigurationError: The data is not as its type says.
        SourceError: The file cannot be read.
    """
    fields = tuples(json_of(data))
    if not isinstance(fields, dict):
        raise ConfigurationError(f"a {message.__name__} is a JSON object, not {data[:40]!r}")
    if unknown := [name for name in fields if name not in message.model_fields]:
        raise ConfigurationError(
            f"{message.__name__} has no field {unknown[0]!r}; "
            f"its fields: {', '.join(message.model_fields)}"
        )
    if not issubclass(message, Stamped):
        try:
            return PlainMessage(message.from_map(fields))
        except PayloadError as error:
            raise ConfigurationError(error.detail) from None
    camera, size = given_header(key, fields.pop("header", None))
    return StampedMessage(message, fields, camera, size)
