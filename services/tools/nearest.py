"""What to say when nothing is found under a name: what does exist, the nearest first."""

from __future__ import annotations

import difflib
from collections.abc import Iterable

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
    near = difflib.get_close_matches(wanted, known, 1, cutoff=0.6)
    hint = f"did you mean {near[0]}? " if near else ""
    shown = difflib.get_close_matches(wanted, known, MOST, cutoff=0.0) if known[MOST:] else known
    more = f" and {len(known) - len(shown)} more" if len(known) > len(shown) else ""
    return f"nothing matches {wanted}: {hint}these exist: {', '.join(sorted(shown))}{more}"
