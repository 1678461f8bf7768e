"""Encodes messages as msgpack and decodes them, checking every field and the size."""

from __future__ import annotations

import reprlib
from typing import Any, ClassVar, Self

import msgpack
from pydantic import BaseModel, ConfigDict, ValidationError

from zenoh_vision.errors import PayloadError
from zenoh_vision.keys import short_name_of

MAX_MESSAGE_BYTES = 1 << 20


class Message(BaseModel):
    """Base of every message: frozen, strictly typed, unknown fields ignored.

    Subclasses set ``schema_name``, the versioned name in the Zenoh encoding, and ``omit_nil``, the
    optional fields that they leave out while these are nil.
    """

    model_config = ConfigDict(
        frozen=True,
        strict=True,
        extra="ignore",
        allow_inf_nan=False,
        validate_by_name=True,  # ``class`` is no name in Python
        serialize_by_alias=True,
    )

    schema_name: ClassVar[str] = ""
    omit_nil: ClassVar[tuple[str, ...]] = ()

    @classmethod
    def short_name(cls) -> str:
        """Return ``Centroid`` where ``schema_name`` is ``vision.Centroid.v1``."""
        return short_name_of(cls.schema_name)

    def to_map(self) -> dict[str, Any]:
        """Return the fields as they are sent."""
        return self._sent()

    def _sent(self, exclude: set[str] | None = None) -> dict[str, Any]:
        fields = self.model_dump(exclude=exclude)
        for name in self.omit_nil:
            if fields[name] is None:
                del fields[name]
        return fields

    def to_bytes(self) -> bytes:
        """Return the message as msgpack bytes."""
        return bytes(msgpack.packb(self.to_map()))

    @classmethod
    def from_map(cls, fields: object) -> Self:
        """Check a decoded map against this message's fields.

        Raises:
            PayloadError: ``bad_message``, with the field and what was wrong with it.
        """
        try:
            return cls.model_validate(fields)
        except ValidationError as error:
            raise PayloadError("bad_message", first_error(cls.__name__, error)) from None

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


def first_error(name: str, error: ValidationError) -> str:
    """Return the first error of a message: the field, what is wrong, and a part of its value."""
    first = error.errors(include_url=False)[0]
    place = ".".join(str(part) for part in (name, *first["loc"]))
    # repr itself raises RecursionError on input that is nested deep enough.
    return f"{place}: {first['msg']}, got {reprlib.repr(first['input']):.80}"
