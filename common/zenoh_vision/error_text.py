"""Texts for people: shortens values, masks passwords, suggests names, escapes foreign text."""

from __future__ import annotations

import difflib
import re
import reprlib
from collections.abc import Iterable, Sequence

MAX_CHARACTERS = 80
SHORTENED_CHARACTERS = 60

USER_WITHOUT_SCHEME = re.compile(r"^[^/:@\s]+:[^\s@]*@")
USER = re.compile(r"://.*@", re.DOTALL)
USER_ALONE = re.compile(r"(://(?!\[)[^/?#:@]*:)(?!\d{0,5}(?:[/?#]|$)).*", re.DOTALL)
"""A user and a password without a host: what follows the colon is no port."""
SECRET_FIELD = re.compile(
    r"([^=&?/#;]*(?:pass|pwd|pw|psw|pin|token|key|secret|auth|cred|sig|session)[^=&?/#;]*=)[^&]*",
    re.IGNORECASE | re.DOTALL,
)


def without_password(text: str) -> str:
    """Return a text with the secrets of a URL in it masked, wherever the URL has them.

    They are user and password before the host, and values whose names say that they are secret, in
    the query, the path or the fragment. Rather too much is masked than too little: everything up to
    the last ``@``, and a value up to the next ``&``, since people paste passwords with any
    character in them. Of a text without ``://``, only ``user:password@`` at its start is masked.
    """
    before, separator, after = text.partition("://")
    if not separator:
        return USER_WITHOUT_SCHEME.sub("***@", text)
    url = USER_ALONE.sub(r"\1***", USER.sub("://***@", separator + after))
    return before + SECRET_FIELD.sub(r"\1***", url)


class _WithoutPasswords(reprlib.Repr):
    def repr_str(self, x: str, level: int) -> str:
        return super().repr_str(without_password(x), level)


def shortened(value: object) -> str:
    """Return the ``repr`` of a value, with long texts and lists shortened and passwords masked.

    Accepts values of any nesting depth, for which ``repr`` may raise ``RecursionError``.
    """
    if not isinstance(value, str):
        return _WithoutPasswords().repr(value)
    value = without_password(value)
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
