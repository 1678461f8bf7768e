"""Fits a stream of compressed pictures into a budget of bandwidth. Pure arithmetic, no clock.

First the JPEG quality falls, then the size, then the rate. Quality changes cost a receiver nothing
and follow each picture. A change of size makes trackers learn their background again, so it waits
until the lowest quality has been too much for a second, or until the larger size would have fitted
for ten.
"""

from __future__ import annotations

from dataclasses import dataclass

FLOOR = 30
"""Lowest quality, unless a lower one is configured."""
STEP = 5
"""Quality changes in these steps, so that it is constant while sizes of pictures vary a little."""
DIVISORS = (1, 2, 4)
"""Divisors of each side of the picture."""

MODEL = 0.77
"""The size in bytes is proportional to the scale of libjpeg's quantization tables to the power of
minus this, as measured for qualities 50 to 95, see docs/deploy.md. This is only a prediction, which
each picture that is sent corrects."""
SMALLER = 3.0
"""A quarter of the pixels takes a third of the bytes, since small pictures have more detail."""
LARGER = 4.0
"""Four times the pixels take at most four times the bytes."""

OVERHEAD = 300
"""Bytes sent with each picture in addition to the picture: its header and Zenoh's."""
SEGMENTS = 1.05
"""Bytes on the wire per byte of a picture, with the packets' headers of TCP, IP and Ethernet."""
SHARE = 0.9
"""Share of the budget for which quality and size are chosen; the rest is a margin."""
LONGEST_S = 0.25
"""Quality and size are chosen so that a picture takes the whole budget for at most this time, at
any rate: one that takes longer is old when it arrives."""
CEILING_S = 2 * LONGEST_S
"""A picture that takes the budget for longer is not sent if the next one can be smaller."""
BURST_S = 0.1
"""Unused budget is kept for this time."""

RISE_S = 1.0
SHRINK_S = 1.0
GROW_S = 10.0
MOST_GROW_S = 300.0
"""A size that was too large is tried again after twice the time, at most this."""
RISE_SHARE = 0.9
GROW_SHARE = 0.7
REPLY_SHARE = 0.5
"""Share of the budget for replies to queries while someone subscribes, so that many queries cannot
end the stream."""
REPLY_CHARGE_S = 1.0
"""A large reply delays frames for at most this time; later replies wait until it is covered."""
FORGET_S = 10.0
"""Without a subscriber for this time, the next one begins with the configured quality and size."""


@dataclass(frozen=True, slots=True)
class Plan:
    """How to encode a picture.

    Attributes:
        quality: JPEG quality.
        divisor: Divisor of each side of the picture.
        untouched: Whether a JPEG of the source may be passed on unchanged.
    """

    quality: int
    divisor: int = 1
    untouched: bool = True


class _Since:
    """Measures for how long a condition has held without a break."""

    def __init__(self) -> None:
        self._since_s: float | None = None

    def holds(self, condition: bool, now_s: float, for_s: float) -> bool:
        """Record whether the condition holds; tell whether it has held for this time."""
        if not condition:
            self._since_s = None
        elif self._since_s is None:
            self._since_s = now_s
        return self._since_s is not None and now_s - self._since_s >= for_s

    def restart(self) -> None:
        """Begin again."""
        self._since_s = None


class RateControl:
    """Chooses quality, size and rate of one stream, picture by picture.

    For each picture, call ``plan``; if someone subscribes, ``is_due``, and if it is, ``fits`` with
    the encoded picture's size; send it if that is True. For each query, call ``wait_to_reply``.

    Attributes:
        dropping: Whether one of the last pictures was not sent.
    """

    def __init__(self) -> None:
        self._quality = 0
        self._level = 0
        self._bytes: float | None = None  # of a picture of this size, at quality 50
        self._fresh = True  # the size was changed and nothing measured since
        self._untouched = True
        self._rate = 0.0
        self._balance = 0.0
        self._replies = 0.0  # balance of the share for replies
        self._interval_s: float | None = None
        self._is_first = True
        self._now_s: float | None = None
        self._refilled_s: float | None = None
        self._wanted_s: float | None = None
        self._unwanted = 0
        self._dropped_s: float | None = None
        self._grown_s: float | None = None
        self._grow_s = GROW_S
        self._rise, self._shrink, self._grow, self._pass = _Since(), _Since(), _Since(), _Since()
        self._plan = Plan(100)

    @property
    def dropping(self) -> bool:
        """Whether a picture of the last second was not sent."""
        dropped_s, now_s = self._dropped_s, self._now_s
        return dropped_s is not None and now_s is not None and now_s - dropped_s < 1.0

    def plan(
        self,
        now_s: float,
        rate: float,
        quality: int,
        *,
        lossless: bool = False,
        packet: int | None = None,
    ) -> Plan:
        """Return how to encode the picture that was captured now.

        Args:
            now_s: Monotonic time.
            rate: The budget, bytes a second.
            quality: The configured quality, which is never exceeded.
            lossless: Whether the picture becomes a PNG, so that only the rate can change.
            packet: Size of the source's JPEG, if it could be passed on.
        """
        self._advance(now_s, rate)
        self._unwanted += 1
        unwanted = self._unwanted > 2 and now_s - (self._wanted_s or 0.0) > FORGET_S
        if self._wanted_s is None or unwanted:
            self._forget(quality)
        self._quality = min(self._quality, quality)
        if lossless:
            self._plan = Plan(quality)
            return self._plan
        if packet is not None:
            self._consider_packet(packet, now_s)
        if self._bytes is not None and not (self._untouched and packet is not None):
            self._choose_quality(quality, now_s)
            self._choose_size(quality, now_s)
        self._plan = Plan(self._quality, DIVISORS[self._level], self._untouched)
        return self._plan

    def is_due(self) -> bool:
        """Tell whether the budget allows to send a picture now."""
        self._wanted_s, self._unwanted = self._now_s, 0
        if self._balance >= 0:
            return True
        self._dropped_s = self._now_s
        return False

    def fits(self, size: int, *, lossless: bool = False, packet: bool = False) -> bool:
        """Record the size of the encoded picture, and tell whether to send it.

        Args:
            size: Bytes.
            lossless: Whether it is a PNG.
            packet: Whether it is the source's own JPEG.
        """
        taken = SEGMENTS * size + OVERHEAD
        if not lossless and not packet:
            self._measure(size)
        smallest = self._level == len(DIVISORS) - 1 and self._quality <= FLOOR
        too_large = taken > self._rate * CEILING_S and not lossless and not smallest
        if too_large:
            self._dropped_s = self._now_s
            if packet:
                self._untouched = False
            elif self._quality <= FLOOR:
                self._resize(self._level + 1)
            return False
        self._balance -= taken
        return True

    def wait_to_reply(self, now_s: float, size: int) -> float:
        """Charge a reply to a query; return 0 if it may be sent, else the seconds to wait.

        A reply of any size is sent at once if the budget has covered the replies before it. Its
        bytes are taken from the budget of the next frames, for up to ``REPLY_CHARGE_S``.

        Args:
            now_s: Monotonic time.
            size: Bytes.
        """
        self._refill(now_s, self._rate)
        if self._replies < 0:
            return -self._replies / self._reply_rate
        taken = SEGMENTS * size + OVERHEAD
        self._balance -= min(taken, self._rate * REPLY_CHARGE_S)
        self._replies -= taken
        return 0.0

    @property
    def _reply_rate(self) -> float:
        """Bytes a second that replies may take: all of them if nobody subscribes."""
        return self._rate if self._unwanted > 2 else REPLY_SHARE * self._rate

    def _refill(self, now_s: float, rate: float) -> None:
        """Add the budget of the time since the last call, at the current rate."""
        if self._refilled_s is not None:
            passed_s = max(0.0, now_s - self._refilled_s)
            self._balance += passed_s * rate
            self._replies = min(0.0, self._replies + passed_s * self._reply_rate)
        self._balance = min(self._balance, rate * BURST_S)
        if rate < self._rate:  # a debt shrinks with the rate, as its time stays the same
            self._balance = max(self._balance, self._balance * rate / self._rate)
            self._replies *= rate / self._rate
        self._refilled_s, self._rate = now_s, rate

    def _advance(self, now_s: float, rate: float) -> None:
        if self._now_s is not None:
            counted_s = min(max(0.0, now_s - self._now_s), 1.0)
            if self._interval_s is not None:
                self._interval_s += 0.1 * (counted_s - self._interval_s)
            elif not self._is_first:  # the first waited for the start, so the second came soon
                self._interval_s = counted_s
            self._is_first = False
        self._refill(now_s, rate)
        self._now_s = now_s

    def _forget(self, quality: int) -> None:
        self._quality, self._level, self._bytes = quality, 0, None
        self._fresh = self._untouched = True
        self._grow_s, self._grown_s = GROW_S, None
        for each in (self._rise, self._shrink, self._grow, self._pass):
            each.restart()

    @property
    def _target(self) -> float:
        """Bytes that one picture may have, at the current rate of pictures."""
        interval_s = LONGEST_S if self._interval_s is None else self._interval_s
        return (SHARE * self._rate * min(interval_s, LONGEST_S) - OVERHEAD) / SEGMENTS

    def _consider_packet(self, size: int, now_s: float) -> None:
        """Decide whether to pass on the source's JPEGs: while they fit, or have fitted for long."""
        if self._untouched:
            self._untouched = size <= self._target and self._level == 0
        elif self._pass.holds(size <= RISE_SHARE * self._target, now_s, self._grow_s):
            self._untouched = True
            self._level, self._bytes, self._fresh = 0, None, True
            self._pass.restart()

    def _choose_quality(self, configured: int, now_s: float) -> None:
        target = self._target
        best = highest_fitting(self._bytes or 0.0, target, configured)
        if best < self._quality:
            self._quality = best
            self._rise.restart()
            return
        higher = min(configured, self._quality + STEP)
        fits = predicted(self._bytes or 0.0, higher) <= RISE_SHARE * target
        may_rise = higher > self._quality and fits
        if self._rise.holds(may_rise, now_s, RISE_S):
            self._quality = higher
            self._rise.restart()

    def _choose_size(self, configured: int, now_s: float) -> None:
        lowest = predicted(self._bytes or 0.0, min(FLOOR, configured))
        last = self._level == len(DIVISORS) - 1
        if self._shrink.holds(not last and lowest > self._target, now_s, SHRINK_S):
            self._resize(self._level + 1)
            self._quality = highest_fitting(self._bytes or 0.0, self._target, configured)
            return
        fits = self._level > 0 and LARGER * lowest <= GROW_SHARE * self._target
        if self._grow.holds(fits, now_s, self._grow_s):
            self._grown_s = now_s
            self._resize(self._level - 1)
            self._quality = highest_fitting(self._bytes or 0.0, self._target, configured)

    def _resize(self, level: int) -> None:
        if level == self._level or level >= len(DIVISORS):
            return
        now_s = self._now_s or 0.0
        if level > self._level:
            too_soon = self._grown_s is not None and now_s - self._grown_s < 3 * self._grow_s
            self._grow_s = min(MOST_GROW_S, 2 * self._grow_s) if too_soon else GROW_S
        self._bytes = (self._bytes or 0.0) * (1 / SMALLER if level > self._level else LARGER)
        self._level, self._fresh = level, True
        for each in (self._rise, self._shrink, self._grow):
            each.restart()

    def _measure(self, size: int) -> None:
        seen = size / _weight(self._plan.quality)
        if self._bytes is None or self._fresh:
            self._bytes, self._fresh = seen, False
        else:
            self._bytes += (0.5 if seen > self._bytes else 0.1) * (seen - self._bytes)


def predicted(at_50: float, quality: int) -> float:
    """Return the bytes of a picture at a quality, by those at quality 50."""
    return at_50 * _weight(quality)


def highest_fitting(at_50: float, target: float, configured: int) -> int:
    """Return the highest quality at which a picture fits, or the lowest one."""
    floor = min(FLOOR, configured)
    qualities = [*range(configured, floor, -STEP), floor]
    return next((each for each in qualities if predicted(at_50, each) <= target), floor)


def _weight(quality: int) -> float:
    """Return the bytes at a quality over those at quality 50, by the scale of libjpeg's tables."""
    scale = 5000 / quality if quality < 50 else 200 - 2 * quality
    return float((max(1.0, scale) / 100) ** -MODEL)
