"""Matches subscribers' key expressions with streams, by Zenoh's rules, in bounded time."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Iterable, Sequence

import zenoh

MAX_CHARACTERS = 200
MAX_DEEP = 2
"""Most ``**`` and ``$*`` in an expression: with more, Zenoh may take seconds to match a key."""

MAX_TESTS = 10_000
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
        if len(text) > MAX_CHARACTERS or text.count("**") + text.count("$*") > MAX_DEEP:
            continue
        try:
            expression = zenoh.KeyExpr.autocanonize(text)
        except zenoh.ZError:
            continue
        found[text] = [key for key in keys[first:last] if expression.intersects(zenoh.KeyExpr(key))]
    return found
