"""What someone who mistyped a name probably meant."""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Sequence

ALIKE = 0.6
"""How alike names must be to be taken for one another, from 0 to 1."""


def nearest(name: str, known: Iterable[str], *, most: int = 1, alike: float = ALIKE) -> list[str]:
    """Return the known names that are like another, the nearest first; capitals are no matter.

    Args:
        name: What was typed.
        known: What there is.
        most: So many at the most.
        alike: How alike they must be; at 0 the nearest are found, however far.
    """
    spellings: dict[str, list[str]] = {}
    for each in known:
        spellings.setdefault(each.casefold(), []).append(each)
    near = difflib.get_close_matches(name.casefold(), spellings, most, alike)
    return [each for one in near for each in spellings[one]][:most]


def question(near: Sequence[str], *, before: str = "", after: str = "") -> str:
    """Return the question which of some names was meant; nothing if there are none.

    Args:
        near: The names, as they shall be shown.
        before: Stands before the question, if there is one.
        after: Stands behind it, if there is one.
    """
    return f"{before}did you mean {' or '.join(near)}?{after}" if near else ""


def meant(name: str, known: Iterable[str], *, before: str = "", after: str = "") -> str:
    """Return the question whether the nearest name was meant; nothing if none is near."""
    return question([repr(each) for each in nearest(name, known)], before=before, after=after)
