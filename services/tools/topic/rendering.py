"""Fields as text, as one value, as a row of comma-separated values."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

INDENT = "  "
INLINE = 8
"""A list of so many plain values stands on one line."""


class NoSuchField(Exception):
    """A message has no field of that name.

    Attributes:
        known: Those it has.
    """

    def __init__(self, known: Sequence[str]) -> None:
        super().__init__(", ".join(known))
        self.known = list(known)


def lines_of(value: Mapping[str, Any], depth: int = 0) -> Iterator[str]:
    """Yield fields as indented text, one a line."""
    for name, each in value.items():
        yield from _lines(f"{INDENT * depth}{name}:", each, depth)


def _lines(title: str, value: Any, depth: int) -> Iterator[str]:
    if isinstance(value, dict) and value:
        yield title
        yield from lines_of(value, depth + 1)
    elif isinstance(value, list) and not _is_short(value):
        yield title
        for each in value:
            if isinstance(each, dict) and each:
                first, *more = lines_of(each, depth + 2)
                yield f"{INDENT * (depth + 1)}- {first.lstrip()}"
                yield from more
            else:
                yield from _lines(f"{INDENT * (depth + 1)}-", each, depth + 1)
    else:
        yield f"{title} {text_of(value)}"


def _is_short(values: Sequence[Any]) -> bool:
    return len(values) <= INLINE and not any(isinstance(each, (dict, list)) for each in values)


def text_of(value: Any) -> str:
    """Return a value as one line of text: texts as they are, the rest as JSON."""
    return value if isinstance(value, str) else json.dumps(value, ensure_ascii=False)


def pick(value: Any, path: Sequence[str]) -> Any:
    """Return the field at a path: ``header seq``, ``box 2``; ``tracks id`` is that of each.

    Raises:
        NoSuchField: Naming those there are at that place.
    """
    if not path:
        return value
    if isinstance(value, dict):
        for end in range(len(path), 0, -1):  # a name may have dots: dropped.stale
            name = ".".join(path[:end])
            if name in value:
                return pick(value[name], path[end:])
        raise NoSuchField(list(value))
    name, *rest = path
    if isinstance(value, list):
        if name.isdecimal():
            if int(name) < len(value):
                return pick(value[int(name)], rest)
            raise NoSuchField([f"0 to {len(value) - 1}"] if value else ["none: it is empty"])
        return [pick(each, path) for each in value]
    if value is None:
        return None  # an object that is not there has no x either
    raise NoSuchField([f"none: it is {text_of(value)}"])


def flat(value: Mapping[str, Any], before: str = "") -> dict[str, Any]:
    """Return fields of fields under dotted names; lists stay one value."""
    found: dict[str, Any] = {}
    for name, each in value.items():
        if isinstance(each, dict):
            found |= flat(each, f"{before}{name}.")
        else:
            found[f"{before}{name}"] = each
    return found


def csv_line(values: Sequence[Any]) -> str:
    """Return values as a line of RFC 4180, without its end; None is empty, lists are JSON."""
    buffer = io.StringIO()
    cells = ["" if value is None else text_of(value) for value in values]
    csv.writer(buffer, lineterminator="").writerow(cells)
    return buffer.getvalue()
