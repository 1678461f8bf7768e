"""Says why a camera's pictures show no motion: another view, too low a rate, no region in them."""

from __future__ import annotations

from collections import deque
from statistics import median
from typing import Final

from zv.tracker.foreground.view import Shown

CHANGED_S: Final = 3.0
"""For this long after a change of the view the tracker says so; then the background is known."""

SLOW_S: Final = 0.3
"""Interval of frames above which a moving object may be too far from its last place to be found."""

INTERVALS: Final = 3
"""The rate is the median of so many intervals: one pause, or a clock that is set, is no rate."""


class SceneReport:
    """Judges the frames of one camera."""

    def __init__(self) -> None:
        self._stamp_ns: int | None = None
        self._changed_ns: int | None = None
        self._intervals_s: deque[float] = deque(maxlen=INTERVALS)

    def update(self, stamp_ns: int, shown: Shown, *, blind: bool = False) -> str:
        """Return what is wrong with a frame as a sentence; empty if nothing is.

        Args:
            stamp_ns: Its capture time.
            shown: What it shows.
            blind: Whether the regions leave nothing of it where objects are detected.
        """
        before, self._stamp_ns = self._stamp_ns, stamp_ns
        if before is not None and stamp_ns > before:
            self._intervals_s.append((stamp_ns - before) / 1e9)
        if blind:
            return "nothing is detected: `regions` and `ignore` leave no part of the picture"
        if shown == "nothing":
            return "the picture shows nothing: it is black, or the lens is covered"
        if shown == "other":
            self._changed_ns = stamp_ns
        since_ns = None if self._changed_ns is None else stamp_ns - self._changed_ns
        if since_ns is not None and 0 <= since_ns < CHANGED_S * 1e9:
            return "the view has changed: no motion is found until its background is learned"
        full = len(self._intervals_s) == INTERVALS
        if full and (interval_s := median(self._intervals_s)) > SLOW_S:
            return (
                f"{1 / interval_s:.1f} frames/s: objects that move farther than their own "
                "size between two frames are not followed"
            )
        return ""
