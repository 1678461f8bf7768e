"""Keeps the compressed pictures of a camera within its setting ``max_kbps``."""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable

from zenoh_vision.image.frame import Frame
from zenoh_vision.image.picture import Picture
from zenoh_vision.keys import JPEG, PNG
from zv.camera.bandwidth import Plan, RateControl

log = logging.getLogger(__name__)

UNCHANGED = Plan(100)
PARTS = {1: "full size", 2: "a half of each side", 4: "a quarter of each side"}


class StreamLimit:
    """Makes the compressed pictures that are sent, and decides which are; safe between threads.

    A picture that is made smaller shows the same frame: header and coordinates stay as they are.
    Raw pixels and shared memory take no share of the budget.

    Args:
        max_kbps: Returns the budget, 1000 bit/s; None for no limit.
        clock_s: Returns the monotonic time.
    """

    def __init__(
        self, max_kbps: Callable[[], int | None], clock_s: Callable[[], float] = time.monotonic
    ) -> None:
        self._max_kbps = max_kbps
        self._clock_s = clock_s
        self._control = RateControl()
        self._plan = UNCHANGED  # that of the last picture that was sent
        self._quality = 0
        self._lock = threading.Lock()  # queries ask on another thread

    def compress(self, frame: Frame) -> bytes | None:
        """Return the JPEG or PNG to send for a frame; None if the budget forbids to send it.

        A JPEG of the source is passed on if it fits, and a PNG always has all values.

        Raises:
            PayloadError: It cannot be decoded or encoded.
        """
        kbps, now_s = self._max_kbps(), self._clock_s()
        with self._lock:
            if kbps is None:
                if self._plan is not UNCHANGED or self._quality:
                    self._control, self._quality = RateControl(), 0
                    self._follow(UNCHANGED)
                return frame.compressed
            control, picture = self._control, frame.picture
            if not control.is_due(now_s, kbps * 1000 / 8):
                return None
            self._quality = frame.quality
            fits = picture.mime == JPEG == picture.form and len(frame.compressed) <= control.target
            if fits or picture.mime == PNG:
                self._follow(UNCHANGED)
                control.spend(len(frame.compressed))
                return frame.compressed
            while True:
                plan = control.plan(now_s, frame.quality)
                data = _encoded(picture, plan)
                if control.accepts(len(data)):
                    self._follow(plan)
                    return data

    def may_reply(self, size: int) -> str | None:
        """Return why a compressed picture must not be a reply to a query now; None if it may be.

        The bytes of the reply are charged to the budget. Called on any thread.
        """
        if (kbps := self._max_kbps()) is None:
            return None
        with self._lock:
            wait_s = self._control.wait_to_reply(self._clock_s(), kbps * 1000 / 8, size)
        if not wait_s:
            return None
        return f"max_kbps = {kbps} is used up by earlier replies; ask again in {wait_s:.1f} s"

    def words(self) -> str:
        """How pictures differ from the settings, for diagnostics; empty if they do not."""
        kbps, now_s, plan = self._max_kbps(), self._clock_s(), self._plan
        if kbps is None or self._control.is_idle(now_s):
            return ""
        found = []
        if plan.quality < self._quality:
            found.append(f"quality {plan.quality} instead of {self._quality}")
        if plan.divisor > 1:
            found.append(PARTS[plan.divisor])
        if self._control.is_dropping(now_s):
            found.append("fewer frames")
        return f"max_kbps = {kbps}: {', '.join(found)}" if found else ""

    def _follow(self, plan: Plan) -> None:
        if plan.divisor != self._plan.divisor:
            log.info("max_kbps: pictures have %s from now on", PARTS[plan.divisor])
        self._plan = plan


def _encoded(picture: Picture, plan: Plan) -> bytes:
    """Return a picture as JPEG with the quality and size of a plan."""
    if plan.divisor > 1 or picture.form is not None:
        width, height = (max(1, round(side / plan.divisor)) for side in picture.size)
        picture = picture.scaled(width, height)
    return picture.compressed(plan.quality)
