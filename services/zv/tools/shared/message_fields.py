"""Fields of samples as plain values and as text: all of a message, the properties of a picture."""

from __future__ import annotations

import csv
import io
import json
import math
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from typing import Any

from zenoh_vision.errors import PayloadError
from zenoh_vision.keys import JSON, UNCOMPRESSED
from zenoh_vision.message_codec import unpack
from zv.tools.shared.received import Received

MSGPACK = "application/msgpack"
TEXTS = ("text/", "zenoh/string", JSON)
UNTYPED = ("zenoh/bytes", "application/octet-stream")
"""Encodings that do not describe the payload, which may still be a msgpack map."""

MAX_TEXT_BYTES = 64 << 10
MAX_DEPTH = 32

INDENT = "  "
INLINE_VALUES = 8
"""A list of at most this many plain values is shown on one line."""


# Samples to fields


def fields_of(sample: Received, *, header: bool = True) -> dict[str, Any]:
    """Return the fields of a sample as JSON values, with or without its header."""
    if sample.deleted:
        return {"deleted": True}
    if sample.encoding.startswith(MSGPACK):
        found = _message_fields(sample)
    elif sample.encoding in UNTYPED and (message := map_in(sample.payload)):
        found = message
    else:
        own = map_in(sample.attachment)
        found = {} if own is None else {"header": own}
        found |= _picture_fields(sample, own) if sample.is_picture else _foreign_fields(sample)
    if not header:
        found.pop("header", None)
    return found


def map_in(packed: bytes | None) -> dict[str, Any] | None:
    """Return the msgpack map in a payload or attachment; None if there is none."""
    try:
        value = plain(unpack(packed or b""))
    except PayloadError:
        return None
    return value if isinstance(value, dict) else None


def _message_fields(sample: Received) -> dict[str, Any]:
    """Return the fields of a msgpack message, or why it cannot be read."""
    if sample.payload is None:
        return {"unreadable": f"{sample.size} bytes", "bytes": sample.size}
    try:
        found = plain(unpack(sample.payload))
    except PayloadError as error:
        return {"unreadable": error.detail, "bytes": sample.size}
    return found if isinstance(found, dict) else {"value": found}


def _picture_fields(sample: Received, header: dict[str, Any] | None) -> dict[str, Any]:
    """Return a picture's format and size, by its header or else by the picture itself."""
    width = height = None
    if header is not None:
        width, height = header.get("width"), header.get("height")
    elif sample.payload is not None and sample.encoding not in UNCOMPRESSED:
        from zenoh_vision.image.codecs import picture_size  # imports OpenCV: a fifth of a second

        with suppress(PayloadError):
            width, height = picture_size(sample.payload)
    return {
        "format": UNCOMPRESSED.get(sample.encoding) or sample.encoding.partition("/")[2],
        "width": width,
        "height": height,
        "encoding": None if header is None else header.get("encoding"),
        "bytes": sample.size,
    }


def _foreign_fields(sample: Received) -> dict[str, Any]:
    """Return text or JSON of other programs unchanged; for other payloads the size."""
    payload = sample.payload
    if payload is None or sample.size > MAX_TEXT_BYTES or not sample.encoding.startswith(TEXTS):
        return {"encoding": sample.encoding, "bytes": sample.size}
    text = payload.decode(errors="replace")
    if not sample.encoding.startswith(JSON):
        return {"text": text}
    try:
        value = plain(json.loads(text))
    except (ValueError, RecursionError):
        value = text
    return value if isinstance(value, dict) else {"value": value}


def plain(value: object, depth: int = 0) -> Any:
    """Return a decoded value as a JSON value; values nested too deep are left out."""
    if depth > MAX_DEPTH:
        return "..."
    if isinstance(value, dict):
        return {str(name): plain(each, depth + 1) for name, each in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain(each, depth + 1) for each in value]
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if value is None or isinstance(value, (bool, int, str)):
        return value
    return f"{len(value)} bytes" if isinstance(value, bytes) else str(value)


# Fields to text


class NoSuchField(Exception):
    """A message has no field of that name; the arguments are the existing names."""


def lines_of(fields: Mapping[str, Any], indent: str = "") -> Iterator[str]:
    """Yield fields as indented text, one per line."""
    for name, value in fields.items():
        yield from _lines(f"{name}:", value, indent)


def _lines(title: str, value: Any, indent: str) -> Iterator[str]:
    inner = indent + INDENT
    if isinstance(value, dict) and value:
        yield indent + title
        yield from lines_of(value, inner)
    elif isinstance(value, list) and not _fits_on_a_line(value):
        yield indent + title
        for each in value:
            if isinstance(each, dict) and each:
                first, *more = lines_of(each, inner + INDENT)
                yield f"{inner}- {first.lstrip()}"
                yield from more
            else:
                yield from _lines("-", each, inner)
    else:
        yield f"{indent}{title} {text_of(value)}"


def _fits_on_a_line(values: Sequence[Any]) -> bool:
    nested = any(isinstance(each, (dict, list)) for each in values)
    return len(values) <= INLINE_VALUES and not nested


def text_of(value: Any) -> str:
    """Return a value as one line of text: strings as they are, the rest as JSON."""
    return value if isinstance(value, str) else json.dumps(value, ensure_ascii=False)


def pick(value: Any, path: Sequence[str]) -> Any:
    """Return the field at a path: ``header seq``, ``box 2``; ``tracks id`` gives all tracks' ids.

    Raises:
        NoSuchField: With the names that exist at that place.
    """
    if not path or value is None:  # a field of a missing object is missing too
        return value
    name, *rest = path
    if isinstance(value, dict):
        for end in range(len(path), 0, -1):  # a name may have dots: dropped.stale
            dotted = ".".join(path[:end])
            if dotted in value:
                return pick(value[dotted], path[end:])
        raise NoSuchField(*value)
    if not isinstance(value, list):
        raise NoSuchField(f"none: it is {text_of(value)}")
    if not name.isdecimal():
        return [pick(each, path) for each in value]
    if int(name) >= len(value):
        raise NoSuchField(f"0 to {len(value) - 1}" if value else "none: it is empty")
    return pick(value[int(name)], rest)


def flat(value: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    """Return nested fields under dotted names; lists stay one value."""
    found: dict[str, Any] = {}
    for name, each in value.items():
        if isinstance(each, dict):
            found |= flat(each, f"{prefix}{name}.")
        else:
            found[f"{prefix}{name}"] = each
    return found


def csv_line(values: Sequence[Any]) -> str:
    """Return values as a line of RFC 4180, without its end; None is empty, lists are JSON."""
    buffer = io.StringIO()
    cells = ["" if value is None else text_of(value) for value in values]
    csv.writer(buffer, lineterminator="").writerow(cells)
    return buffer.getvalue()
