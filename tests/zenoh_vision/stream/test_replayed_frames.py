"""Replayed frames keep their stamps; their age and order are those of the replay."""

from __future__ import annotations

import pytest

from tests.support.headers import NOW_NS, header
from zenoh_vision.errors import PayloadError
from zenoh_vision.messages import Header
from zenoh_vision.stream.epoch_gate import EpochGate

S = 10**9
MAX_AGE_NS = 4 * S // 10
RECORDED_NS = NOW_NS - 3600 * S


def replayed(seq: int, recorded_s: float, sent_s: float, begun_s: float = 0.0) -> Header:
    return header(
        seq,
        stamp_ns=RECORDED_NS + round(recorded_s * S),
        replay=NOW_NS + round(begun_s * S),
        replayed_ns=NOW_NS + round(sent_s * S),
    )


def shown(gate: EpochGate, found: Header, at_s: float) -> bool:
    """Tell whether a consumer takes a frame that arrives at a monotonic time."""
    at_ns = round(at_s * S)
    gate.admit(found, at_ns)
    if gate.is_stale(found, MAX_AGE_NS, at_ns):
        return False
    gate.accept(found, at_ns, at_ns, MAX_AGE_NS)
    return True


@pytest.mark.parametrize("speed", [0.1, 0.5, 4.0])
def test_no_frame_is_stale_at_another_speed(speed: float):
    gate = EpochGate("front")
    for seq in range(200):
        recorded_s = seq / 30
        assert shown(gate, replayed(seq, recorded_s, recorded_s / speed), recorded_s / speed), seq


def test_a_frame_that_waited_since_the_replay_sent_it_is_stale():
    gate = EpochGate("front")
    for seq in range(5):
        assert shown(gate, replayed(seq, seq / 10, seq / 10), seq / 10)
    assert not shown(gate, replayed(5, 0.5, 0.5), 0.5 + 0.41)


def test_a_frame_to_which_the_answer_is_waited_for_is_never_stale():
    gate = EpochGate("front")
    for seq in range(5):
        assert shown(gate, replayed(seq, seq / 10, seq / 10), seq / 10)
    waited = replayed(5, 0.5, 0.5).model_copy(update={"lockstep": True})
    assert shown(gate, waited, 0.5 + 30.0)


def test_frames_are_shown_at_once_after_a_jump_back_and_those_of_before_no_more():
    gate = EpochGate("front")
    assert shown(gate, replayed(90, 3.0, 0.0), 0.0)
    assert shown(gate, replayed(10, 0.3, 0.1, begun_s=0.1), 0.1)
    with pytest.raises(PayloadError, match="out_of_order"):
        gate.admit(replayed(91, 3.1, 0.1), S // 10)


def test_a_later_epoch_of_the_recording_follows_within_a_pass():
    gate = EpochGate("front")
    assert shown(gate, replayed(90, 3.0, 0.0), 0.0)
    reopened = replayed(0, 4.0, 0.1).model_copy(update={"epoch": 200})
    assert shown(gate, reopened, 0.1)


def test_frames_of_a_live_camera_are_not_mixed_with_a_replay_of_its_name():
    gate = EpochGate("front")
    live = {"epoch": NOW_NS - 60 * S}
    assert shown(gate, header(7, **live), 0.0)
    assert shown(gate, replayed(90, 3.0, 0.1), 0.1)
    with pytest.raises(PayloadError, match="out_of_order"):
        gate.admit(header(8, **live), S // 10)


def test_a_pass_that_begins_tomorrow_is_refused():
    gate = EpochGate("front")
    tomorrow = replayed(0, 0.0, 0.0, begun_s=25 * 3600)
    with pytest.raises(PayloadError, match=r"replay .* over 24 h ahead") as caught:
        gate.identify(tomorrow.to_bytes(), (64, 48), NOW_NS, 0)
    assert caught.value.reason == "bad_stamp"
