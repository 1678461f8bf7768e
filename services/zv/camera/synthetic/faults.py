"""Faults on demand: failures of real cameras, at a known frame for a known time."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal, cast, get_args

from zenoh_vision.error_text import shortened

FaultKind = Literal["stall", "frozen", "drop", "lighting"]
KINDS: tuple[FaultKind, ...] = get_args(FaultKind)
FORM = (
    "KIND@FRAME+FRAMES such as stall@90+60 or stall@now+60, FRAMES above 0, both below 1000000, "
    f"KIND one of {' '.join(KINDS)}"
)

_PATTERN = re.compile(r"([^@+]*)@(0*[0-9]{1,6}|now)\+(0*[1-9][0-9]{0,5})")


@dataclass(frozen=True, slots=True)
class Fault:
    """A failure of the camera.

    Attributes:
        kind: ``stall``: reading blocks for ``frames`` frame times. ``frozen``: the picture of
            frame ``at`` is repeated. ``drop``: the frames are skipped at once. ``lighting``:
            the light in the room is brighter.
        at: First frame with the fault, from 0; None for the next frame when the fault is set,
            which is the first one in an epoch that begins later.
        frames: Number of frames with the fault, at least 1.
    """

    kind: FaultKind
    at: int | None
    frames: int

    def from_frame(self, k: int) -> Fault:
        """Return the fault with its first frame, if it is set before frame k."""
        return Fault(self.kind, k, self.frames) if self.at is None else self

    @property
    def end(self) -> int:
        """The first frame after the fault."""
        return (self.at or 0) + self.frames

    def covers(self, k: int) -> bool:
        """Tell whether frame k has the fault."""
        return (self.at or 0) <= k < self.end


def parse_faults(text: str) -> tuple[Fault, ...]:
    """Read faults from text such as ``stall@90+60, lighting@300+30``; empty for none.

    Raises:
        ValueError: A fault does not have that form; the text has the fault and the form.
    """
    if not text.strip():
        return ()
    return tuple(_parse_fault(part.strip()) for part in text.split(","))


def fault_at(faults: Iterable[Fault], k: int, kinds: tuple[FaultKind, ...]) -> Fault | None:
    """Return the first listed fault of one of these kinds that frame k has, or None."""
    for fault in faults:
        if fault.kind in kinds and fault.covers(k):
            return fault
    return None


def _parse_fault(text: str) -> Fault:
    match = _PATTERN.fullmatch(text)
    if match is None:
        raise ValueError(f"fault {shortened(text)}: expected {FORM}")
    if match[1] not in KINDS:
        raise ValueError(f"fault {shortened(text)}: no kind {shortened(match[1])}; expected {FORM}")
    kind = cast("FaultKind", match[1])
    return Fault(kind, None if match[2] == "now" else int(match[2]), int(match[3]))
