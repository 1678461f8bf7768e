"""Matches the key expressions of other programs with keys, by Zenoh's rules, in bounded time."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Iterable, Sequence

import zenoh

from zenoh_vision.transport.declarations import Sessions

MAX_CHARACTERS = 200
MAX_DEEP = 2
"""Most ``**`` and ``$*`` in an expression: with more, Zenoh may take seconds to match a key."""

MAX_TESTS = 10_000
MAX_PATTERNS = 100
"""Most expressions with wildcards that are compared with each key."""

LAST = "\U0010ffff"


def matches(expressions: Iterable[str], keys: Sequence[str]) -> dict[str, list[str]]:
    """Return which of the sorted keys each expression with wildcards matches.

    Expressions without wildcards are left out, since they match only themselves. So are those that
    are invalid, too long or too deep, and all that remain after ``MAX_TESTS`` comparisons.
    """
    found, tests = {}, 0
    for text in sorted({text for text in expressions if "*" in text}):
        literal = text.partition("*")[0].rpartition("/")[0]  # every match has this prefix
        first, last = bisect_left(keys, literal), bisect_left(keys, literal + LAST)
        tests += last - first
        if tests > MAX_TESTS:
            break
        if (expression := _comparable(text)) is not None:
            found[text] = [k for k in keys[first:last] if expression.intersects(zenoh.KeyExpr(k))]
    return found


class SessionIndex:
    """Finds the sessions of a key in time that does not grow with the number of keys."""

    def __init__(self, sessions: Sessions) -> None:
        self._sessions = sessions
        patterns = [key for key in sessions if "*" in key][:MAX_PATTERNS]
        self._patterns = {key: found for key in patterns if (found := _comparable(key)) is not None}

    def matching(self, key: str) -> set[str]:
        """Return the sessions whose key or expression matches a key."""
        fitting = [text for text, each in self._patterns.items() if intersect(each, key)]
        return {who for text in {key, *fitting} for who in self._sessions.get(text, ())}


def intersect(expression: str | zenoh.KeyExpr, key: str) -> bool:
    """Tell whether a key expression matches a key; False if one of them is not valid."""
    try:
        return zenoh.KeyExpr(key).intersects(expression)
    except zenoh.ZError:
        return False


def _comparable(text: str) -> zenoh.KeyExpr | None:
    if len(text) > MAX_CHARACTERS or text.count("**") + text.count("$*") > MAX_DEEP:
        return None
    try:
        return zenoh.KeyExpr.autocanonize(text)
    except zenoh.ZError:
        return None
