"""Encodes messages of ROS 2 as CDR: little-endian XCDR1, as all middlewares of ROS 2 send them."""

from __future__ import annotations

import struct
from collections.abc import Mapping, Sequence
from typing import Any, Final

from zv.bag.ros2.messages import TYPES

LITTLE_ENDIAN: Final = b"\0\1\0\0"
PRIMITIVES: Final = {
    "bool": "?",
    "uint8": "B",
    "int32": "i",
    "uint32": "I",
    "float64": "d",
}


def cdr(name: str, values: Mapping[str, Any]) -> bytes:
    """Encode a message; missing fields are 0, empty, or so themselves.

    Raises:
        struct.error: A number does not fit into its field.
    """
    out = bytearray()
    _message(out, name, values)
    return LITTLE_ENDIAN + bytes(out)


def _message(out: bytearray, name: str, values: Mapping[str, Any]) -> None:
    for kind, field in TYPES[name]:
        inner, bracket, size = kind.partition("[")
        value = values.get(field)
        if not bracket:
            _value(out, inner, value)
            continue
        items: Sequence[Any] | bytes = () if value is None else value
        length = size.rstrip("]")
        if not length:
            _number(out, "I", len(items))
        elif len(items) != int(length):
            items = [*items, *[0] * int(length)][: int(length)]
        if inner == "uint8":
            out += bytes(items)
        elif inner in PRIMITIVES:
            if len(items):
                code = PRIMITIVES[inner]
                _align(out, struct.calcsize(code))
                out += struct.pack(f"<{len(items)}{code}", *items)
        else:
            for item in items:
                _value(out, inner, item)


def _value(out: bytearray, kind: str, value: Any) -> None:
    if kind == "string":
        text = str(value or "").encode() + b"\0"
        _number(out, "I", len(text))
        out += text
    elif kind in PRIMITIVES:
        _number(out, PRIMITIVES[kind], value or 0)
    else:
        _message(out, kind, value or {})


def _number(out: bytearray, code: str, value: float) -> None:
    _align(out, struct.calcsize(code))
    out += struct.pack(f"<{code}", value)


def _align(out: bytearray, size: int) -> None:
    out += bytes(-len(out) % size)
