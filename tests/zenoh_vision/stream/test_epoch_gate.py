"""Which arrivals may be seen: each at most once, never after a newer one."""

from __future__ import annotations

import random

import pytest

from tests.support.headers import NOW_NS, header
from tests.support.library import seen
from zenoh_vision.errors import PayloadError
from zenoh_vision.messages import Header
from zenoh_vision.stream.epoch_gate import SILENCE_NS, EpochGate

SILENCE_S = SILENCE_NS / 1e9
S = 10**9
MAX_AGE_NS = 4 * S // 10


def refusal(gate: EpochGate, found: Header, at_s: float = 0.0) -> str:
    with pytest.raises(PayloadError) as caught:
        gate.admit(found, int(at_s * 1e9))
    return caught.value.reason


def test_frames_in_order_are_admitted_and_gaps_counted():
    gate = EpochGate("front")
    assert gate.admit(header(5), 0) == (True, 0)  # joined late: nothing was missed
    gate.accept(header(5), 0, 0)
    assert gate.admit(header(6), 0) == (False, 0)
    assert gate.admit(header(9), 0) == (False, 2)  # 7 and 8
    assert gate.admit(header(10), 0) == (False, 0)


def test_a_false_frame_that_takes_long_to_decode_silences_the_true_ones_no_longer():
    gate = EpochGate("front")
    seen(gate, header(5, epoch=100))
    false = header(0, epoch=200)
    gate.admit(false, S)
    gate.accept(false, S, 3 * S)  # decoded for 2 s
    assert refusal(gate, header(6, epoch=100), at_s=1.0 + SILENCE_S - 0.01) == "out_of_order"
    assert gate.admit(header(7, epoch=100), int((1.0 + SILENCE_S) * S)) == (True, 0)


@pytest.mark.parametrize("seq", [0, 4, 5], ids=["much older", "older", "the same again"])
def test_a_frame_that_is_not_newer_is_refused(seq: int):
    gate = EpochGate("front")
    seen(gate, header(5))
    assert refusal(gate, header(seq)) == "out_of_order"


def test_a_frame_overtaken_while_it_waited_is_overwritten_by_the_newer_one():
    gate = EpochGate("front")
    gate.admit(header(0), 0)
    assert gate.admit(header(1), 0) == (True, 0)  # waits apart, as unverified
    gate.accept(header(0), 0, 0)
    assert gate.admit(header(2), 0) == (False, 0)  # verified, and so taken first
    gate.accept(header(2), 0, 0)
    with pytest.raises(PayloadError, match="frame 1 after 2") as caught:
        gate.accept(header(1), 0, 0)
    assert caught.value.reason == "overwritten"
    with pytest.raises(PayloadError) as caught:
        gate.accept(header(2), 0, 0)
    assert caught.value.reason == "out_of_order"


def test_a_frame_admitted_but_never_seen_does_not_close_the_door():
    gate = EpochGate("front")
    seen(gate, header(0))
    gate.admit(header(7), 0)  # could not be decoded
    assert gate.admit(header(1), 0) == (False, 0)


def test_a_newer_epoch_takes_over_only_with_a_frame_that_is_seen():
    gate = EpochGate("front")
    seen(gate, header(5, epoch=100))
    assert gate.admit(header(0, epoch=200), 0) == (True, 0)
    assert gate.admit(header(6, epoch=100), 0) == (False, 0)  # still the proven one
    gate.accept(header(0, epoch=200), 0, 0)
    assert refusal(gate, header(7, epoch=100)) == "out_of_order"
    assert gate.admit(header(1, epoch=200), 0) == (False, 0)


def test_unverified_frames_that_arrived_during_the_first_decode_are_not_missed():
    gate = EpochGate("front")
    for seq in (0, 1, 2):
        gate.admit(header(seq), 0)
    gate.accept(header(0), 0, 0)
    assert gate.admit(header(3), 0) == (False, 0)
    assert gate.admit(header(5), 0) == (False, 1)


def test_unverified_frames_of_another_epoch_do_not_count_as_arrived():
    gate = EpochGate("front")
    gate.admit(header(0, epoch=200), 0)
    gate.admit(header(50, epoch=100), 0)
    gate.accept(header(0, epoch=200), 0, 0)
    assert gate.admit(header(2, epoch=200), 0) == (False, 1)


def test_an_older_epoch_follows_only_after_silence():
    """A camera that was started again while its clock was set back."""
    gate = EpochGate("front")
    seen(gate, header(5, epoch=200), at_s=10.0)
    assert refusal(gate, header(0, epoch=100), at_s=10.0 + SILENCE_S - 0.01) == "out_of_order"
    seen(gate, header(0, epoch=100), at_s=10.0 + SILENCE_S)
    assert gate.admit(header(1, epoch=100), 12_100_000_000) == (False, 0)


@pytest.mark.parametrize("step", [1001, 10**6, 2**63, 2**64 - 1 - 5])
def test_a_seq_that_no_camera_can_have_reached_is_refused_and_nothing_is_missed(step: int):
    gate = EpochGate("front")
    seen(gate, header(5), at_s=1.0)
    assert refusal(gate, header(5 + step), at_s=1.0) == "out_of_order"
    assert gate.admit(header(6), S) == (False, 0)


def test_a_subscriber_that_was_away_for_an_hour_goes_on_with_the_same_epoch():
    gate = EpochGate("front")
    seen(gate, header(5), at_s=1.0)
    an_hour_later = 3601 * S
    assert gate.admit(header(6 + 3600 * 240), an_hour_later) == (False, 3600 * 240)


class Stream:
    """A camera at 30 Hz and its gate; each frame takes 5 ms on its way and 1 ms to decode."""

    def __init__(self, epoch: int = NOW_NS - 60 * S, seq: int = 1800) -> None:
        self.gate = EpochGate("front")
        self.now_ns = 10 * S
        self.epoch, self.seq = epoch, seq

    def send(self, **changes: object) -> bool:
        """Let a good picture arrive, the camera's next if nothing else is said; return whether
        it was handed out."""
        fields = {"epoch": self.epoch, "seq": self.seq, "stamp_ns": NOW_NS + self.now_ns}
        found = header(**(fields | changes))
        arrived_ns = self.now_ns + 5 * 10**6
        try:
            self.gate.admit(found, arrived_ns)
            if self.gate.is_stale(found, MAX_AGE_NS, arrived_ns):
                return False
            self.gate.accept(found, arrived_ns, arrived_ns + 10**6, MAX_AGE_NS)
        except PayloadError:
            return False
        return True

    def run(self, seconds: float) -> list[float]:
        """Return the times of the camera's frames that were handed out, after now."""
        begun_ns, times = self.now_ns, []
        while self.now_ns - begun_ns < seconds * S:
            if self.send():
                times.append((self.now_ns - begun_ns) / S)
            self.seq += 1
            self.now_ns += S // 30
        return times


@pytest.mark.parametrize("joined_before", [True, False])
@pytest.mark.parametrize("seq", [2**63, 2**64 - 1, 1801 + 900, 0])
def test_one_good_picture_with_another_seq_ends_no_stream(seq: int, joined_before: bool):
    stream = Stream()
    if joined_before:
        stream.run(1)
    stream.send(seq=seq)
    times = stream.run(5)
    assert times[0] < 2
    assert len(times) >= 3 * 30  # and all frames that follow


def test_frames_that_a_queue_brings_again_after_a_silence_are_refused():
    stream = Stream()
    stream.run(2)
    again = range(stream.seq - 60, stream.seq)
    stream.now_ns += 3 * S
    handed_out = []
    for seq in again:  # within 0.6 s, each as long after its capture as it came out
        stamp_ns = NOW_NS + stream.now_ns - 5 * S + (seq - again[0]) * S // 30
        handed_out.append(stream.send(seq=seq, stamp_ns=stamp_ns))
        stream.now_ns += S // 100
    assert not any(handed_out)


@pytest.mark.parametrize("seed", range(8))
def test_after_any_burst_of_hostile_headers_the_frames_are_back_within_2_s(seed: int):
    rng = random.Random(seed)
    for _ in range(100):
        stream = Stream()
        if rng.random() < 0.9:
            stream.run(rng.uniform(0.1, 3))
        for _ in range(rng.choice([1, 1, 2, 5, 30])):
            stream.send(**hostile(rng, stream))
            if rng.random() < 0.5:
                stream.run(rng.choice([0.04, 0.3]))
        times = stream.run(6)
        assert times, "no frame of the camera was handed out again"
        assert times[0] < 2
        # From then on each of them.
        assert len(times) == pytest.approx((6 - times[0]) * 30, abs=1.5)


def hostile(rng: random.Random, stream: Stream) -> dict[str, int]:
    """Return fields of a header that looks good: identity and time are wrong, a lot or a little."""
    near = [rng.randrange(-2000, 2000), rng.randrange(-5, 5)]
    now_ns = NOW_NS + stream.now_ns
    day = 24 * 3600 * S - S
    return {
        "epoch": rng.choice(
            [stream.epoch, stream.epoch, stream.epoch + 1, now_ns + rng.randrange(day), 0]
        ),
        "seq": rng.choice([2**63, 2**64 - 1, 0, max(0, stream.seq + rng.choice(near)), stream.seq]),
        "stamp_ns": max(
            0, now_ns + rng.choice([0, -day, day, rng.randrange(-3 * S, 3 * S), -now_ns])
        ),
    }
