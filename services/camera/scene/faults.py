"""Faults on demand: what a real camera does wrong, at a known frame for a known time."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal, get_args

from common.excerpt import excerpt

FaultKind = Literal["stall", "frozen", "drop", "lighting"]

KINDS: tuple[FaultKind, ...] = get_args(FaultKind)
FORM = f"KIND@FRAME+FRAMES such as stall@90+60 or stall@now+60, KIND one of {' '.join(KINDS)}"

_PATTERN = re.compile(r"([^@+]*)@([0-9]{1,18}|now)\+([0-9]{1,18})")


@dataclass(frozen=True, slots=True)
class Fault:
    """One fault.

    Attributes:
        kind: ``stall``: reading blocks for so many frame times. ``frozen``: the picture of
            frame ``at`` comes again and again. ``drop``: the frames are skipped at once.
            ``lighting``: the light in the room is brighter.
        at: First frame that has it, from 0; None for the frame that is next when the fault is
            set, which in an epoch that begins later is its first.
        frames: How many have it, at least 1.

    Raises:
        ValueError: If a number is out of range.
    """

    kind: FaultKind
    at: int | None
    frames: int

    def __post_init__(self) -> None:
        """Refuse numbers that no fault has."""
        if (self.at is not None and self.at < 0) or self.frames < 1:
            raise ValueError(f"{self}: the frame must be 0 or more, the number of frames 1 or more")

    def __str__(self) -> str:
        """Return the text that ``parse_faults`` reads."""
        return f"{self.kind}@{'now' if self.at is None else self.at}+{self.frames}"

    def from_frame(self, k: int) -> Fault:
        """Return it as it is when it is set before frame k."""
        return Fault(self.kind, k, self.frames) if self.at is None else self

    @property
    def end(self) -> int:
        """The first frame after it."""
        return (self.at or 0) + self.frames

    def covers(self, k: int) -> bool:
        """Tell whether frame k has it."""
        return (self.at or 0) <= k < self.end


def parse_faults(text: str) -> tuple[Fault, ...]:
    """Read faults from text such as ``stall@90+60, lighting@300+30``.

    Args:
        text: Faults separated by commas; empty for none. Spaces do not matter.

    Raises:
        ValueError: If a fault is not of that form, naming it and the form.
    """
    if not text.strip():
        return ()
    return tuple(_parse_fault(part.strip()) for part in text.split(","))


def fault_at(faults: Iterable[Fault], k: int, kinds: Iterable[FaultKind]) -> Fault | None:
    """Return the first listed fault of one of these kinds that frame k has, or None."""
    wanted = tuple(kinds)
    return next((fault for fault in faults if fault.kind in wanted and fault.covers(k)), None)


def _parse_fault(text: str) -> Fault:
    match = _PATTERN.fullmatch(text)
    if match is None:
        raise ValueError(f"fault {excerpt(text)}: expected {FORM}")
    kind = next((known for known in KINDS if known == match[1]), None)
    if kind is None:
        raise ValueError(f"fault {excerpt(text)}: no kind {excerpt(match[1])}; expected {FORM}")
    if not int(match[3]):
        raise ValueError(f"fault {text!r}: 0 frames is no fault; expected {FORM}, FRAMES above 0")
    return Fault(kind, None if match[2] == "now" else int(match[2]), int(match[3]))
