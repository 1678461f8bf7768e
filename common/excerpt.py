"""A wrong value as an error shows it: whole if it is short, else its beginning and length."""

from __future__ import annotations

import reprlib

LONGEST = 80
BEGINNING = 60
"""Characters."""


def excerpt(value: object) -> str:
    """Return a value in Python's spelling, a long text or list cut short.

    Args:
        value: Anything that a file, a flag or the network may hold; however deep, since ``repr``
            itself raises ``RecursionError`` on input that is nested deep enough.
    """
    if not isinstance(value, str):
        return reprlib.repr(value)
    if len(value) <= LONGEST:
        return repr(value)
    return f"{value[:BEGINNING]!r}... ({len(value)} characters)"
