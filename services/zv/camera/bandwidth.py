"""Fits a stream of compressed pictures into a budget of bandwidth. Pure arithmetic, no clock.

First the JPEG quality falls, then the size, then the rate. Neither changes the coordinates of a
frame, so both follow the pictures at once when they become larger, and rise again step by step.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

FLOOR = 30  # lowest quality, unless a lower one is configured
STEP = 5  # of the quality, so that it is constant while sizes of pictures vary a little
SHARES = {1: 1.0, 2: 1 / 3, 4: 1 / 9}
"""Share of the bytes by the divisor of each side: a small picture has more for each pixel."""
MODEL = 0.77
"""Bytes are proportional to the scale of libjpeg's quantization tables to the power of minus this,
as measured for qualities 50 to 95, see docs/deploy.md; each picture corrects the prediction."""

OVERHEAD = 300  # bytes sent in addition to each picture: its header and Zenoh's
SEGMENTS = 1.05  # bytes on the wire per byte, with the headers of TCP, IP and Ethernet
TARGET = 0.9  # share of the budget for which quality and size are chosen; the rest is a margin
LONGEST_S = 0.25
"""A picture should take the whole budget for at most this time: later, it is old on arrival."""
BURST_S = 0.1  # unused budget is kept for this time
RISE_S, MOST_RISE_S = 1.0, 60.0
"""Time for which more must fit until it is tried; doubled each time that it was too much."""
RISE_SHARE = 0.9
REPLY_SHARE = 0.5
"""Share of the budget for replies to queries while someone subscribes, so that many queries cannot
end the stream."""
REPLY_CHARGE_S = 1.0
"""A large reply delays frames for at most this time; later replies wait until it is covered."""
IDLE_S = 2.0  # without a subscriber for this time, replies have all of the budget
FORGET_S = 10.0
"""Without a subscriber for this time, the next one begins with the configured quality and size."""


@dataclass(frozen=True, slots=True)
class Plan:
    """How to encode a picture."""

    quality: int
    divisor: int = 1  # of each side

    @property
    def weight(self) -> float:
        """Bytes of the picture over those at quality 50 and full size, by the model."""
        scale = 5000 / self.quality if self.quality < 50 else 200 - 2 * self.quality
        return SHARES[self.divisor] * float((max(1.0, scale) / 100) ** -MODEL)


@lru_cache(maxsize=4)
def plans(configured: int) -> tuple[Plan, ...]:
    """Return all plans up to a quality, from the most bytes to the fewest."""
    floor = min(FLOOR, configured)
    found: list[Plan] = []
    for divisor in SHARES:
        for quality in (*range(configured, floor, -STEP), floor):
            plan = Plan(quality, divisor)
            if not found or plan.weight < found[-1].weight:
                found.append(plan)
    return tuple(found)


class Ladder:
    """Chooses quality and size of one stream by the bytes of its pictures."""

    def __init__(self) -> None:
        self._plans: tuple[Plan, ...] = ()
        self._at = 0
        self._at_50 = 0.0  # bytes of a picture at quality 50 and full size; 0 before the first
        self._rise_s = RISE_S
        self._fits_since_s: float | None = None
        self._risen_s: float | None = None

    def plan(self, now_s: float, configured: int, target: float) -> Plan:
        """Return how to encode a picture that may have ``target`` bytes."""
        if (found := plans(configured)) is not self._plans:
            self._plans, self._at = found, 0
        lower, higher = self._first_within(target), self._first_within(RISE_SHARE * target)
        if lower > self._at:
            failed = self._risen_s is not None and now_s - self._risen_s < 3 * self._rise_s
            self._rise_s = min(MOST_RISE_S, 2 * self._rise_s) if failed else RISE_S
            self._at, self._fits_since_s = lower, None
        elif higher >= self._at:
            self._fits_since_s = None
        elif self._fits_since_s is None:
            self._fits_since_s = now_s
        elif now_s - self._fits_since_s >= self._rise_s:
            self._at, self._fits_since_s, self._risen_s = higher, None, now_s
        return self._plans[self._at]

    def measure(self, size: int, most: float) -> bool:
        """Record the bytes of a picture encoded by the plan, and tell whether to send it.

        If it has more than ``most`` and can be smaller, encode it again by the next plan.
        """
        seen = size / self._plans[self._at].weight
        if size > most and self._at < len(self._plans) - 1:
            self._at_50, self._at = seen, self._at + 1
            return False
        gain = 1.0 if not self._at_50 else 0.5 if seen > self._at_50 else 0.1
        self._at_50 += gain * (seen - self._at_50)
        return True

    def _first_within(self, size: float) -> int:
        """Return the place of the first plan of at most so many bytes, or of the last one."""
        fitting = (i for i, plan in enumerate(self._plans) if plan.weight * self._at_50 <= size)
        return next(fitting, len(self._plans) - 1)


class RateControl:
    """Chooses quality, size and rate of one stream, picture by picture, and charges replies.

    For each picture that someone wants, call ``is_due``; if it is, either ``spend`` its bytes, or
    encode it by the ``plan`` until ``accepts`` is True. For each query, call ``wait_to_reply``.
    Times are monotonic.
    """

    def __init__(self) -> None:
        self._ladder = Ladder()
        self._interval_s = LONGEST_S  # between two pictures
        self._rate = 0.0
        self._balance = 0.0  # bytes that may be sent; negative while earlier ones are not covered
        self._replies = 0.0  # as above, of the share for replies
        self._refilled_s = self._wanted_s = self._withheld_s = -math.inf

    def is_due(self, now_s: float, rate: float) -> bool:
        """Tell whether the budget, bytes a second, allows to send a picture that is wanted now."""
        passed_s = now_s - self._wanted_s
        if passed_s > FORGET_S:
            self._ladder = Ladder()
        self._interval_s += 0.2 * (min(passed_s, LONGEST_S) - self._interval_s)
        self._refill(now_s, rate)
        self._wanted_s = now_s
        if self._balance < 0:
            self._withheld_s = now_s
        return self._balance >= 0

    @property
    def target(self) -> float:
        """Bytes that one picture may have, at the current rate of pictures."""
        return (TARGET * self._rate * self._interval_s - OVERHEAD) / SEGMENTS

    def plan(self, now_s: float, configured: int) -> Plan:
        """Return how to encode a picture, with at most the configured quality."""
        return self._ladder.plan(now_s, configured, self.target)

    def accepts(self, size: int) -> bool:
        """Record the bytes of a picture encoded by the plan, and tell whether to send it.

        If it would occupy the link for twice ``LONGEST_S`` and can be smaller, encode it again by
        the next plan.
        """
        if not self._ladder.measure(size, (2 * LONGEST_S * self._rate - OVERHEAD) / SEGMENTS):
            return False
        self.spend(size)
        return True

    def spend(self, size: int) -> None:
        """Record that a picture of so many bytes is sent."""
        self._balance -= SEGMENTS * size + OVERHEAD

    def is_dropping(self, now_s: float) -> bool:
        """Tell whether a picture of the last second was not sent."""
        return now_s - self._withheld_s < 1.0

    def is_idle(self, now_s: float) -> bool:
        """Tell whether nobody has wanted a picture lately."""
        return now_s - self._wanted_s > IDLE_S

    def wait_to_reply(self, now_s: float, rate: float, size: int) -> float:
        """Charge a reply to a query; return 0 if it may be sent, else the seconds to wait.

        A reply of any size is sent at once if the budget has covered the replies before it. Its
        bytes are taken from the budget of the next frames, for up to ``REPLY_CHARGE_S``.
        """
        self._refill(now_s, rate)
        if self._replies < 0:
            return -self._replies / (rate * self._reply_share(now_s))
        taken = SEGMENTS * size + OVERHEAD
        self._balance -= min(taken, rate * REPLY_CHARGE_S)
        self._replies -= taken
        return 0.0

    def _reply_share(self, now_s: float) -> float:
        return 1.0 if self.is_idle(now_s) else REPLY_SHARE

    def _refill(self, now_s: float, rate: float) -> None:
        """Add the budget of the time since the last call, at the current rate."""
        gained = max(0.0, now_s - self._refilled_s) * rate
        self._balance = min(self._balance + gained, rate * BURST_S)
        self._replies = min(0.0, self._replies + gained * self._reply_share(now_s))
        if rate < self._rate:  # a debt shrinks with the rate, as its time stays the same
            self._balance = max(self._balance, self._balance * rate / self._rate)
            self._replies *= rate / self._rate
        self._refilled_s, self._rate = now_s, rate
