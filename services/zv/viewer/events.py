"""JSON texts of the page's WebSocket, in which JavaScript can represent all numbers exactly."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Mapping

MAX_SAFE_INTEGER = 2**53
"""The largest integer that JavaScript represents exactly."""

MAX_DEPTH = 20


def text(op: str, **fields: object) -> str:
    """Return one message to a page."""
    return to_json({"op": op, **fields})


def list_text(op: str, items: Iterable[str]) -> str:
    """Return the message to a page with a list of items that are JSON already."""
    return f'{{"op":"{op}","{op}":[{",".join(items)}]}}'


def to_json(fields: Mapping[str, object]) -> str:
    """Return fields as compact JSON for JavaScript."""
    return json.dumps(plain(fields), ensure_ascii=False, separators=(",", ":"))


def plain(value: object, name: str = "", depth: int = 0) -> object:
    """Return a value in a form that JSON and JavaScript can represent.

    Times, epochs and integers too large for JavaScript become strings; NaN and infinity become
    null. ``name`` is the field that holds the value, ``depth`` the number of maps and lists
    around it.
    """
    if isinstance(value, bool) or value is None or isinstance(value, str):
        return value
    if isinstance(value, int):
        safe = -MAX_SAFE_INTEGER < value < MAX_SAFE_INTEGER
        return value if safe and name != "epoch" and not name.endswith("_ns") else str(value)
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
