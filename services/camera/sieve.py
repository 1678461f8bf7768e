"""Which of the pictures that a source delivers are passed on: not too many, none twice."""

from __future__ import annotations

from services.camera.pacing import Thinner
from services.camera.repeats import RepeatWatch
from services.camera.sources.base import Picture


class Sieve:
    """Thins out a source that paces itself, and finds one that repeats itself.

    Both rates and times may change from one picture to the next.
    """

    def __init__(self) -> None:
        self._thinner: Thinner | None = None
        self._watch: RepeatWatch | None = None

    def lets_through(self, rate_hz: float | None, now_s: float) -> bool:
        """Decide on a picture that came at a monotonic time.

        Args:
            rate_hz: At most so many a second; None for all.
            now_s: When it came.
        """
        if rate_hz is None:
            self._thinner = None
            return True
        if self._thinner is None or self._thinner.rate_hz != rate_hz:
            self._thinner = Thinner(rate_hz)
        return self._thinner.lets_through(now_s)

    def repeats(self, picture: Picture, frozen_after_s: float, now_s: float) -> bool:
        """Tell whether a picture is the one before it once more.

        Args:
            picture: What came.
            frozen_after_s: After so long of repeats the source is ``frozen``; 0: any are right.
            now_s: When it came.
        """
        if not frozen_after_s:
            self._watch = None
            return False
        if self._watch is None:
            self._watch = RepeatWatch(frozen_after_s)
        self._watch.frozen_after_s = frozen_after_s
        return self._watch.repeats(picture, now_s)

    def frozen(self, now_s: float) -> bool:
        """Tell whether nothing but repeats has come for too long."""
        return self._watch is not None and self._watch.frozen(now_s)
