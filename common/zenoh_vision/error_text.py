"""Texts for people: shortens wrong values, suggests similar names, escapes foreign text."""

from __future__ import annotations

import difflib
import reprlib
from collections.abc import Iterable, Sequence

MAX_CHARACTERS = 80
SHORTENED_CHARACTERS = 60


def shortened(value: object) -> str:
    """Return the ``repr`` of a value, with long texts and lists shortened.

    Accepts values of any nesting depth, for which ``repr`` may raise ``RecursionError``.
    """
    if not isinstance(value, str):
        return reprlib.repr(value)
    if len(value) <= MAX_CHARACTERS:
        return repr(value)
    return f"{value[:SHORTENED_CHARACTERS]!r}... ({len(value)} characters)"


def printable(text: str) -> str:
    """Return a text as one line without control characters, which would steer a terminal.

    They are escaped as in Python: line ends, tabs, escape sequences and marks of the direction of
    writing.
    """
    if text.isprintable():
        return text
    return "".join(each if each.isprintable() else repr(each)[1:-1] for each in text)


def joined(names: Iterable[str], most: int = 20) -> str:
    """Return the first ``most`` names separated by commas, and how many more there are."""
    listed = list(names)
    more = f" and {len(listed) - most} more" if len(listed) > most else ""
    return ", ".join(listed[:most]) + more


def similar_names(
    name: str, known: Iterable[str], *, limit: int = 1, similarity: float = 0.6
) -> list[str]:
    """Return at most ``limit`` names that resemble a name, most similar first, ignoring case.

    ``similarity`` is the minimum required, from 0 (none) to 1 (equal).
    """
    spellings: dict[str, list[str]] = {}
    for each in known:
        spellings.setdefault(each.casefold(), []).append(each)
    near = difflib.get_close_matches(name.casefold(), spellings, limit, similarity)
    return [each for one in near for each in spellings[one]][:limit]


def did_you_mean(names: Sequence[str], *, before: str = "", after: str = "") -> str:
    """Return ``did you mean ...?`` between two texts; an empty text if there are no names."""
    return f"{before}did you mean {' or '.join(names)}?{after}" if names else ""


def suggestion(name: str, known: Iterable[str], *, before: str = "", after: str = "") -> str:
    """Return ``did you mean ...?`` for the most similar name; empty if none is similar."""
    return did_you_mean(
        [repr(each) for each in similar_names(name, known)], before=before, after=after
    )
