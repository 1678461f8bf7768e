"""Bytes with something changed, for hypothesis; and what a decoder may do with them."""

from __future__ import annotations

from collections.abc import Callable

from hypothesis import settings
from hypothesis import strategies as st

from common.errors import PayloadError

Changes = list[tuple[str, float, bytes]]

fuzz = settings(derandomize=True, deadline=None, database=None, max_examples=300)

changes = st.lists(
    st.tuples(st.sampled_from(["set", "cut", "insert"]), st.floats(0, 1), st.binary(max_size=4)),
    min_size=1,
    max_size=6,
)


def changed(whole: bytes, how: Changes) -> bytes:
    """Return bytes with some set, cut out or put in, at places given as shares of the length."""
    found = bytearray(whole)
    for kind, share, new in how:
        at = int(share * len(found))
        end = at if kind == "insert" else at + max(1, len(new))
        found[at:end] = b"" if kind == "cut" else new
    return bytes(found)


def tried(decode: Callable[[bytes], object], payload: bytes, reasons: set[str]) -> None:
    reason = None
    try:
        decode(payload)
    except PayloadError as error:
        reason = error.reason
    assert reason is None or reason in reasons
