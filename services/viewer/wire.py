"""What goes to a page: texts as JSON, and pictures with a JSON head."""

from __future__ import annotations

import json
import math
import struct
import time
from collections.abc import Mapping
from dataclasses import dataclass, field

from common.messages import Header

SAFE = 2**53
"""Integers beyond it lose digits as JavaScript's numbers."""

LENGTH = struct.Struct("<I")
MAX_DEPTH = 20


def text(op: str, **fields: object) -> str:
    """Return one message to a page."""
    return json.dumps({"op": op, **plain_map(fields)}, ensure_ascii=False, separators=(",", ":"))


def plain_map(fields: Mapping[str, object]) -> dict[str, object]:
    """Return fields as JSON can say them to JavaScript."""
    return {name: plain(value, name) for name, value in fields.items()}


def plain(value: object, name: str = "", depth: int = 0) -> object:
    """Return a value as JSON can say it to JavaScript.

    Times, epochs and integers that it cannot hold become texts, what is no number becomes null.

    Args:
        value: Of a message: maps, lists, numbers, texts.
        name: Of its field.
        depth: How many maps and lists it is in.
    """
    if isinstance(value, bool) or value is None or isinstance(value, str):
        return value
    if isinstance(value, int):
        exact = name == "epoch" or name.endswith("_ns") or not -SAFE < value < SAFE
        return str(value) if exact else value
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if depth > MAX_DEPTH:
        return "..."
    if isinstance(value, Mapping):
        return {str(key): plain(item, str(key), depth + 1) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain(item, name, depth + 1) for item in value]
    if isinstance(value, bytes):
        return f"{len(value)} bytes"
    return str(value)


@dataclass(slots=True, eq=False)
class Picture:
    """One picture as clients get it.

    Attributes:
        key: Of its stream.
        header: Of the frame that it is.
        payload: JPEG or PNG.
        mime: Which of them.
        width: Of this picture, pixels.
        height: Of this picture, pixels.
        number: How many had come on the key up to it.
        missed: How many had not, by their sequence numbers.
        ended_ns: Since when nothing came behind it, ns since 1970, if it shows that; else None.
        part: What ``/stream`` makes of it, for all programs.
        browser_part: The same for all browsers.
    """

    key: str
    header: Header
    payload: bytes
    mime: str
    width: int
    height: int
    number: int
    missed: int
    ended_ns: int | None = None
    part: bytes = field(default=b"", repr=False)
    browser_part: bytes = field(default=b"", repr=False)
    _head: str = field(default="", repr=False)

    def age_ms(self, now_ns: int) -> float:
        """Return milliseconds from its capture to a time, ns since 1970."""
        return (now_ns - self.header.stamp_ns) / 1e6

    def to_page(self, now_ns: int, *, skipped: int, lost: int) -> bytes:
        """Return the binary message that carries it.

        Args:
            now_ns: When it is sent.
            skipped: How many before it were not sent to this page.
            lost: How many never came here since this page began to watch.
        """
        if not self._head:  # the same for all pages
            fields = {
                "key": self.key,
                "mime": self.mime,
                "header": self.header.to_map(),
                "bytes": len(self.payload),
                "width": self.width,
                "height": self.height,
            }
            self._head = json.dumps(plain_map(fields), separators=(",", ":"))[:-1]
        age_ms = round(self.age_ms(now_ns), 2)
        head = f'{self._head},"age_ms":{age_ms},"skipped":{skipped},"lost":{lost}}}'.encode()
        return b"".join((LENGTH.pack(len(head)), head, self.payload))


def now_ns() -> int:
    """Return the wall clock, ns since 1970."""
    return time.time_ns()
