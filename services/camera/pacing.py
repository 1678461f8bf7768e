"""When to hand over the pictures of a source that has no clock of its own. No clock in here."""

from __future__ import annotations


class Pacer:
    """Keeps a schedule that does not drift, and never hurries to make up for lost time.

    Each picture is due at a fixed time after the first, so that lateness of one does not delay
    the next. Who is later than ``slack_s`` (the machine slept, decoding is too slow) shifts the
    schedule instead: a burst of pictures would only overwrite one another.

    Args:
        slack_s: How late a picture may be and still keep the schedule.
    """

    def __init__(self, slack_s: float = 0.1) -> None:
        self._slack_s = slack_s
        self._base_s: float | None = None

    def wait_s(self, due_s: float, now_s: float) -> float:
        """Return how long to wait before a picture is handed over.

        Args:
            due_s: When it is due, seconds after the source's first picture.
            now_s: Monotonic clock, seconds.
        """
        if self._base_s is None:
            self._base_s = now_s - due_s
        late = now_s - (self._base_s + due_s)
        if late > self._slack_s:
            self._base_s += late
        return max(0.0, -late)


class Schedule:
    """When each picture of a source is due, at a rate that may change at any time."""

    def __init__(self) -> None:
        self._count = 0
        self._rate_hz: float | None = None
        self._last = (0.0, 0.0)
        self._origin = (0, 0.0, 0.0)

    def due_s(self, own_s: float, rate_hz: float | None) -> float:
        """Return when the next picture is due, seconds after the first; asked any number of times.

        Args:
            own_s: When it is by the source's own time.
            rate_hz: So many pictures a second, whatever the source's time is; None: by that.
        """
        if rate_hz != self._rate_hz:
            self._rate_hz = rate_hz
            self._origin = (max(0, self._count - 1), *self._last)
        number, origin_own_s, origin_s = self._origin
        if rate_hz is None:
            return origin_s + own_s - origin_own_s
        return origin_s + (self._count - number) / rate_hz

    def shown(self, own_s: float, due_s: float) -> None:
        """Take note that the next picture was shown when it was due: now another is the next."""
        self._count += 1
        self._last = (own_s, due_s)


class Thinner:
    """Lets through at most so many pictures a second of a source that paces itself.

    Args:
        rate_hz: Pictures per second.
    """

    def __init__(self, rate_hz: float) -> None:
        self.rate_hz = rate_hz
        self._period_s = 1.0 / rate_hz
        self._next_s: float | None = None

    def lets_through(self, now_s: float) -> bool:
        """Decide on a picture that came at a monotonic time."""
        if self._next_s is None:
            self._next_s = now_s
        # A picture a little early counts, or jitter would halve a source of just this rate.
        if now_s < self._next_s - 0.25 * self._period_s:
            return False
        self._next_s = max(self._next_s + self._period_s, now_s)
        return True
