"""How old a frame is without a common clock."""

from __future__ import annotations

import pytest

from tests.support.headers import header
from zenoh_vision.stream.epoch_gate import SETTLE_NS, WINDOW_NS, EpochGate

MS = 10**6
S = 10**9
MAX_AGE = 400 * MS
FRAME = 100 * MS
WAY = 5 * MS


SETTLE_S, WINDOW_S = SETTLE_NS / S, WINDOW_NS / S


class Gauge:
    """The rule on age alone: an epoch gate whose frames are always next in order."""

    def __init__(self) -> None:
        self.gate = EpochGate("front")
        self._seq = 0

    @property
    def offset_ns(self) -> int | None:
        return self.gate.offset_ns

    def arrives(self, epoch: int, stamp: int, now: int) -> bool:
        """Let a frame arrive and return whether it is stale."""
        self._seq += 1
        found = header(self._seq, epoch, stamp_ns=stamp)
        self.gate.admit(found, now)
        return self.gate.is_stale(found, MAX_AGE, now)

    def accept(self, epoch: int, stamp: int, now: int) -> None:
        self._seq += 1
        self.gate.accept(header(self._seq, epoch, stamp_ns=stamp), now, now, MAX_AGE)


def gauge_after(
    frames: int = 10, *, epoch: int = 1, clock: int = 0, start: int = 0
) -> tuple[Gauge, int]:
    """Return a gauge that saw frames at 10 Hz, each 5 ms on its way; and the time here."""
    gauge = Gauge()
    now = start
    for n in range(frames):
        now = start + n * FRAME
        assert not gauge.arrives(epoch, now - WAY + clock, now)
        gauge.accept(epoch, now - WAY + clock, now)
    return gauge, now


def test_the_first_frame_is_never_stale():
    assert not Gauge().arrives(1, 0, 10**18)


def test_a_frame_is_stale_when_it_exceeds_the_best_by_more_than_allowed():
    gauge, now = gauge_after()
    stamp = now + FRAME
    assert not gauge.arrives(1, stamp, stamp + WAY + MAX_AGE)
    assert gauge.arrives(1, stamp, stamp + WAY + MAX_AGE + 1)


@pytest.mark.parametrize("clock", [-3600 * S, -7 * S, -1, 7 * S, 3600 * S], ids=str)
def test_a_clock_that_is_off_makes_no_frame_stale_and_hides_no_stale_one(clock: int):
    gauge, now = gauge_after(clock=clock)
    assert gauge.offset_ns == WAY - clock
    assert gauge.arrives(1, now + clock, now + WAY + MAX_AGE + 1)


def test_a_queue_that_drains_after_a_pause_is_stale_but_for_its_newest():
    gauge, now = gauge_after()
    # A link stands still for 2 s and then delivers at once what was captured meanwhile.
    resumed = now + 2 * S
    stale = [gauge.arrives(1, now + n * FRAME, resumed) for n in range(1, 21)]
    # Frame n was captured 2000 - 100 n ms before: up to 400 + 5 ms is not stale, so n >= 16.
    assert stale == [n < 16 for n in range(1, 21)]


def test_a_queue_that_drains_in_a_new_epoch_is_stale_too():
    gauge, now = gauge_after()
    resumed = now + 3 * S
    for n in range(1, 26):  # 2.9 s down to 0.5 s late, all within the settling time
        assert gauge.arrives(2, now + n * FRAME, resumed + n * MS)


def test_a_clock_set_back_starts_the_measure_afresh():
    gauge, now = gauge_after()
    for n in range(1, 20):
        here = now + n * FRAME
        stamp = here - WAY - 10 * S  # as if every frame were 10 s late
        assert not gauge.arrives(1, stamp, here)
        gauge.accept(1, stamp, here)
    assert gauge.offset_ns == WAY + 10 * S
    assert gauge.arrives(1, stamp + FRAME, here + FRAME + MAX_AGE + 1)


def test_a_clock_set_forward_makes_no_frame_stale():
    gauge, now = gauge_after()
    for n in range(1, 20):
        here = now + n * FRAME
        assert not gauge.arrives(1, here - WAY + 10 * S, here)
        gauge.accept(1, here - WAY + 10 * S, here)
    assert gauge.offset_ns == WAY - 10 * S


def test_a_new_epoch_on_a_clock_behind_settles_in_two_seconds():
    gauge, now = gauge_after()
    begun = now + FRAME
    for n in range(40):
        here = begun + n * FRAME
        stamp = here - WAY - 30 * S
        stale = gauge.arrives(2, stamp, here)
        assert stale == (here - begun <= SETTLE_S * S)
        if not stale:
            gauge.accept(2, stamp, here)
    assert gauge.offset_ns == WAY + 30 * S


def test_a_new_epoch_on_a_clock_ahead_needs_no_settling():
    gauge, now = gauge_after()
    stamp = now + FRAME + 30 * S
    assert not gauge.arrives(2, stamp, now + FRAME)
    gauge.accept(2, stamp, now + FRAME)
    # Measured by the old epoch's clock this one would look young: 30 s must not pass unseen.
    assert gauge.arrives(2, stamp + FRAME, now + 2 * FRAME + MAX_AGE + 1)


def test_a_new_epoch_whose_lateness_varies_is_a_queue_not_a_clock():
    gauge, now = gauge_after()
    begun = now + FRAME
    for n in range(40):
        here = begun + n * FRAME
        jitter = (n % 2) * (MAX_AGE + 1)
        assert gauge.arrives(2, here - 30 * S - jitter, here)


def test_another_challenger_settles_by_itself_from_its_first_frame():
    gauge, now = gauge_after()
    for n in range(19):
        gauge.arrives(2, now + n * FRAME - 30 * S, now + n * FRAME)
    begun = now + 19 * FRAME
    for n in range(30):
        here = begun + n * FRAME
        assert gauge.arrives(3, here - 50 * S, here) == (here - begun <= SETTLE_S * S)


def test_frames_that_are_never_accepted_leave_the_measure_alone():
    gauge, now = gauge_after()
    gauge.arrives(2, now + 3600 * S, now)
    assert gauge.offset_ns == WAY
    assert not gauge.arrives(1, now, now + WAY)


def test_the_best_frame_is_forgotten_after_a_minute():
    gauge = Gauge()
    gauge.accept(1, 0, WAY)
    # A new route is a second longer. By the measure of the old one its frames are stale ...
    second_longer = 1 * S + WAY
    minute = int(WINDOW_S * S)
    assert gauge.arrives(1, minute - second_longer, minute)
    # ... until that has left the window.
    assert not gauge.arrives(1, minute + WAY + 1 - second_longer, minute + WAY + 1)


def test_the_window_is_the_last_minute_not_the_first():
    gauge = Gauge()
    # The way gets 5 ms longer each second: never late against the last minute's best (300 ms
    # less), though after 120 s it is 600 ms longer than at first.
    for second in range(121):
        now = second * S
        stamp = now - second * 5 * MS
        assert not gauge.arrives(1, stamp, now)
        gauge.accept(1, stamp, now)
    assert gauge.offset_ns == 60 * 5 * MS


def test_an_hour_of_frames_costs_no_memory():
    gauge, _ = gauge_after(frames=3600 * 10)
    assert len(gauge.gate._gauge._minima) <= WINDOW_S + 1


@pytest.mark.parametrize(
    ("per_million", "seconds", "stale_from"),
    [
        # What a daemon may turn a clock by: 500 millionths are 0.03 s in the minute remembered.
        (-500, 300, None),
        # Turned ahead, each frame is better than those before.
        (+83_333, 120, None),
        # 400 ms / 0.083333 = 4.8 s after which frames are late against the first of the minute.
        (-83_333, 20, 4.8),
    ],
    ids=["ntpd", "chrony ahead", "chrony back"],
)
def test_a_clock_that_is_turned(per_million: int, seconds: int, stale_from: float | None):
    gauge, begun = gauge_after()
    first = None
    for n in range(1, seconds * 10):
        now = begun + n * FRAME
        stamp = now - WAY + (now - begun) * per_million // 1_000_000
        if gauge.arrives(1, stamp, now):
            first = first or (now - begun) / S
        else:
            gauge.accept(1, stamp, now)
            assert first is None  # once late, all are, until the minute is over
    assert first == (None if stale_from is None else pytest.approx(stale_from, abs=0.15))


def test_frames_late_since_a_clock_was_turned_back_are_taken_again_after_a_minute():
    gauge, begun = gauge_after()
    taken = None
    for n in range(1, 40):  # one frame in 2 s, and the clock was set back by 1 s between two
        now = begun + n * 2 * S
        if not gauge.arrives(1, now - WAY - 1 * S, now):
            taken = (now - begun) / S
            break
    # The second that the frames before it were kept in began 0.9 s before the last of them.
    assert taken == WINDOW_S
