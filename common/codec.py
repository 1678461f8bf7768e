"""Messages to msgpack bytes and back, with every field checked on the way in.

Source: the MessagePack specification; limits are ours, so that no payload costs more memory
than a message can need.
"""

from __future__ import annotations

import reprlib
from typing import Any, ClassVar, Self

import msgpack
from pydantic import BaseModel, ConfigDict, ValidationError

from common.errors import PayloadError

MAX_MESSAGE_BYTES = 1 << 20


class Message(BaseModel):
    """Base of every message: frozen, strictly typed, unknown fields ignored.

    Subclasses set ``schema_name``, the versioned name that stands in the Zenoh encoding.
    """

    model_config = ConfigDict(frozen=True, strict=True, extra="ignore", allow_inf_nan=False)

    schema_name: ClassVar[str] = ""

    def to_map(self) -> dict[str, Any]:
        """Return the plain map that goes on the wire."""
        return self.model_dump()

    def to_bytes(self) -> bytes:
        """Return the message as msgpack bytes."""
        packed: bytes = msgpack.packb(self.to_map(), use_bin_type=True)
        return packed

    @classmethod
    def from_map(cls, fields: object) -> Self:
        """Check a decoded map against this message's fields.

        Raises:
            PayloadError: ``bad_message``, naming the field and what was wrong with it.
        """
        try:
            return cls.model_validate(fields)
        except ValidationError as error:
            raise PayloadError("bad_message", explain(cls.__name__, error)) from None

    @classmethod
    def from_bytes(cls, payload: bytes) -> Self:
        """Decode msgpack bytes and check every field.

        Raises:
            PayloadError: ``bad_message``.
        """
        return cls.from_map(unpack(payload))


def unpack(payload: bytes) -> object:
    """Decode one msgpack value; arrays become tuples.

    Raises:
        PayloadError: ``bad_message`` if it is empty, over ``MAX_MESSAGE_BYTES``, truncated,
            followed by more bytes, nested too deep, or not msgpack at all.
    """
    if len(payload) > MAX_MESSAGE_BYTES:
        raise PayloadError(
            "bad_message", f"{len(payload)} bytes, at most {MAX_MESSAGE_BYTES} are allowed"
        )
    try:
        return msgpack.unpackb(payload, use_list=False, strict_map_key=True)
    except (ValueError, TypeError, OverflowError, msgpack.UnpackException) as error:
        raise PayloadError(
            "bad_message", f"not msgpack: {str(error) or type(error).__name__}"
        ) from None


def explain(name: str, error: ValidationError) -> str:
    """Return the first complaint of a validation as one short sentence."""
    first = error.errors(include_url=False)[0]
    place = ".".join(str(part) for part in (name, *first["loc"]))
    # reprlib: repr itself raises RecursionError on input that is nested deep enough.
    return f"{place}: {first['msg']}, got {reprlib.repr(first['input']):.80}"
