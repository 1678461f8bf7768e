"""What to say when nothing is found under a name: what does exist, the nearest first."""

from __future__ import annotations

from collections.abc import Iterable

from common.near_names import nearest, question

MOST = 12


def nothing_matches(wanted: str, existing: Iterable[str], *, kind: str = "key") -> str:
    """Return the sentence for a name or key expression under which there is nothing.

    Args:
        wanted: What was asked for.
        existing: What there is.
        kind: What it is, in the singular.
    """
    known = sorted(set(existing))
    if not known:
        return f"nothing matches {wanted}: there is no {kind} at all; does a node run?"
    hint = question(nearest(wanted, known), after=" ")
    shown = nearest(wanted, known, most=MOST, alike=0.0) if known[MOST:] else known
    more = f" and {len(known) - len(shown)} more" if len(known) > len(shown) else ""
    return f"nothing matches {wanted}: {hint}these exist: {', '.join(sorted(shown))}{more}"
