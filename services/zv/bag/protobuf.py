"""Protobuf's wire format, and descriptions of messages in it, for the schemas of recordings.

https://protobuf.dev/programming-guides/encoding. The few messages that are needed are written by
hand: the protobuf library would be a dependency of 20 times this size, and slower.
"""

from __future__ import annotations

import re
import struct
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Final

VARINT, FIXED64, BYTES, FIXED32 = 0, 1, 2, 5
"""Wire types."""

TYPES: Final = {
    "double": 1,
    "int64": 3,
    "int32": 5,
    "fixed64": 6,
    "fixed32": 7,
    "bool": 8,
    "string": 9,
    "message": 11,
    "bytes": 12,
    "uint32": 13,
    "enum": 14,
}
"""Numbers of the types in a descriptor."""

OPTIONAL, REPEATED = 1, 3
FIELD: Final = re.compile(r"(repeated )?([\w.]+)(?:\(([\w|]+)\))? (\w+) = (\d+)")


class WireError(ValueError):
    """Bytes that are no protobuf."""


def varint(value: int) -> bytes:
    """Encode a number from 0 to 2^64 - 1."""
    out = bytearray()
    while value > 0x7F:
        out.append(value & 0x7F | 0x80)
        value >>= 7
    out.append(value)
    return bytes(out)


def prefix(number: int, length: int) -> bytes:
    """Return what stands before a field's bytes."""
    return varint(number << 3 | BYTES) + varint(length)


def part(number: int, value: bytes | str) -> bytes:
    """Encode a field that is text, bytes or a message."""
    value = value.encode() if isinstance(value, str) else value
    return prefix(number, len(value)) + value


def count(number: int, value: int) -> bytes:
    """Encode a field that is a number of variable length, or a truth value; nothing for 0."""
    return varint(number << 3 | VARINT) + varint(value) if value else b""


def fixed64(number: int, value: int) -> bytes:
    """Encode a field of type ``fixed64``."""
    return varint(number << 3 | FIXED64) + struct.pack("<Q", value)


def fixed32(number: int, value: int) -> bytes:
    """Encode a field of type ``fixed32``."""
    return varint(number << 3 | FIXED32) + struct.pack("<I", value)


def double(number: int, value: float) -> bytes:
    """Encode a field of type ``double``; nothing for 0."""
    return varint(number << 3 | FIXED64) + struct.pack("<d", value) if value else b""


def doubles(number: int, values: Sequence[float]) -> bytes:
    """Encode a repeated field of type ``double``."""
    return part(number, struct.pack(f"<{len(values)}d", *values)) if values else b""


def timestamp(number: int, ns: int) -> bytes:
    """Encode a field that is a ``google.protobuf.Timestamp``."""
    return part(number, count(1, ns // 1_000_000_000) + count(2, ns % 1_000_000_000))


def fields_of(message: memoryview) -> Iterator[tuple[int, int | memoryview]]:
    """Yield number and value of each field: a number, or the bytes of a longer one.

    Raises:
        WireError: The bytes are no message.
    """
    place, end = 0, len(message)
    while place < end:
        tag, place = _varint_at(message, place)
        number, kind = tag >> 3, tag & 7
        if kind == VARINT:
            value, place = _varint_at(message, place)
            yield number, value
            continue
        length = {FIXED64: 8, FIXED32: 4}.get(kind)
        if kind == BYTES:
            length, place = _varint_at(message, place)
        if length is None or place + length > end:
            raise WireError(f"field {number} has wire type {kind} or ends too early")
        found = message[place : place + length]
        place += length
        yield number, found if kind == BYTES else int.from_bytes(found, "little")


def _varint_at(message: memoryview, place: int) -> tuple[int, int]:
    value = 0
    for index in range(10):
        if place + index >= len(message):
            break
        byte = message[place + index]
        value |= (byte & 0x7F) << 7 * index
        if byte < 0x80:
            return value, place + index + 1
    raise WireError("a number has no end")


@dataclass(frozen=True, slots=True)
class _Field:
    name: str
    number: int
    type: str
    repeated: bool
    choices: tuple[str, ...]


def _fields(text: str) -> list[_Field]:
    found = []
    for each in text.split(", "):
        parts = FIELD.fullmatch(each)
        assert parts is not None, each
        repeated, kind, choices, name, number = parts.groups("")
        options = tuple(choices.split("|")) if choices else ()
        found.append(_Field(name, int(number), kind, bool(repeated), options))
    return found


def descriptor_set(messages: Mapping[str, str]) -> bytes:
    """Return the serialized ``FileDescriptorSet`` of messages, one file for each, in this order.

    Args:
        messages: By their full names, their fields as in a .proto file: ``string text = 3, repeated
            foxglove.Point2 points = 4``. Each message may use those before it. An enumeration is
            nested in its message: ``Type(UNKNOWN|POINTS) type = 2``, in order from 0.
    """
    files, places = b"", dict[str, str]()
    for full_name, text in messages.items():
        fields = _fields(text)
        package, _, name = full_name.rpartition(".")
        places[full_name] = file_name = f"{full_name.replace('.', '/')}.proto"
        used = sorted({places[each.type] for each in fields if each.type in places} - {file_name})
        content = part(1, file_name) + part(2, package)
        content += b"".join(part(3, each) for each in used)
        content += part(4, _descriptor(full_name, name, fields)) + part(12, "proto3")
        files += part(1, content)
    return files


def _descriptor(full_name: str, name: str, fields: Sequence[_Field]) -> bytes:
    out = part(1, name)
    for field in fields:
        kind = "enum" if field.choices else "message" if "." in field.type else field.type
        described = part(1, field.name) + count(3, field.number)
        described += count(4, REPEATED if field.repeated else OPTIONAL) + count(5, TYPES[kind])
        if field.choices:
            described += part(6, f".{full_name}.{field.type}")
        elif kind == "message":
            described += part(6, f".{field.type}")
        out += part(2, described)
    for field in fields:
        if field.choices:
            values = (
                part(2, part(1, choice) + varint(2 << 3 | VARINT) + varint(index))
                for index, choice in enumerate(field.choices)
            )
            out += part(4, part(1, field.type) + b"".join(values))
    return out
