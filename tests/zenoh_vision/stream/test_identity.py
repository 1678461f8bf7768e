"""Whose frame an arrival is: by its header, or made up for a bare picture."""

from __future__ import annotations

import msgpack
import pytest

from tests.support.headers import NOW_NS, header
from tests.support.library import seen
from zenoh_vision.errors import PayloadError
from zenoh_vision.messages import Header
from zenoh_vision.stream.epoch_gate import CLOCK_TOLERANCE_NS, SILENCE_NS, EpochGate

SILENCE_S = SILENCE_NS / 1e9

SIZE = (64, 48)


def identify(
    gate: EpochGate,
    found: Header | None,
    size: tuple[int, int] | None = SIZE,
    at_s: float = 0.0,
    now_ns: int = NOW_NS,
) -> Header:
    attachment = None if found is None else found.to_bytes()
    return gate.identify(attachment, size, now_ns, int(at_s * 1e9))


def test_the_header_that_came_is_the_identity():
    assert identify(EpochGate("front"), header(3)) == header(3, received_ns=NOW_NS)


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        pytest.param({"camera": "rear"}, "wrong_camera", id="another camera"),
        pytest.param({"stamp_ns": -1}, "bad_stamp", id="negative stamp"),
        pytest.param({"stamp_ns": NOW_NS + CLOCK_TOLERANCE_NS + 1}, "bad_stamp", id="a day ahead"),
        pytest.param({"stamp_ns": 2**63 - 1}, "bad_stamp", id="in 2262"),
        pytest.param({"epoch": -1}, "bad_stamp", id="negative epoch"),
        pytest.param({"epoch": NOW_NS + 10**15}, "bad_stamp", id="epoch 11 days ahead"),
    ],
)
def test_a_header_that_cannot_be_right_is_refused(changes: dict[str, object], reason: str):
    with pytest.raises(PayloadError) as caught:
        identify(EpochGate("front"), header(**changes))
    assert caught.value.reason == reason


@pytest.mark.parametrize(
    "off_s", [-3600 * 24 * 365, -5, 0.5, 5, 3600, 24 * 3600], ids=lambda off: f"{off:+g} s"
)
def test_a_clock_that_is_off_is_normal(off_s: float):
    found = header(stamp_ns=NOW_NS + int(off_s * 1e9))
    assert identify(EpochGate("front"), found).stamp_ns == found.stamp_ns


def test_the_time_of_arrival_is_the_receivers_own():
    found = identify(EpochGate("front"), header(3, received_ns=5), now_ns=NOW_NS + 7)
    assert found.received_ns == NOW_NS + 7


def test_an_invalid_time_of_arrival_makes_the_header_bad():
    attachment = msgpack.packb({**header(3).to_map(), "received_ns": "soon"})
    with pytest.raises(PayloadError, match="received_ns") as caught:
        EpochGate("front").identify(attachment, SIZE, NOW_NS, 0)
    assert caught.value.reason == "bad_header"


def test_an_attachment_that_is_no_header_is_refused():
    with pytest.raises(PayloadError) as caught:
        EpochGate("front").identify(b"frame 7", SIZE, NOW_NS, 0)
    assert caught.value.reason == "bad_header"


def test_raw_pixels_have_no_size_of_their_own_to_compare():
    assert identify(EpochGate("front"), header(3), size=None) == header(3, received_ns=NOW_NS)


def test_a_bare_picture_gets_an_identity_that_says_it_was_made_up():
    made_up = identify(EpochGate("front"), None)
    assert made_up == header(0, epoch=NOW_NS, received_ns=NOW_NS, assumed=True)


def test_bare_pictures_are_one_epoch_in_order():
    gate = EpochGate("front")
    for seq in range(3):
        made_up = identify(gate, None, now_ns=NOW_NS + seq, at_s=seq / 10)
        assert (made_up.epoch, made_up.seq, made_up.stamp_ns) == (NOW_NS, seq, NOW_NS + seq)
        seen(gate, made_up, at_s=seq / 10)


def test_raw_pixels_without_a_header_are_refused():
    with pytest.raises(PayloadError) as caught:
        identify(EpochGate("front"), None, size=None)
    assert caught.value.reason == "no_header"


def test_a_bare_picture_on_a_key_that_names_no_camera_is_refused():
    with pytest.raises(PayloadError, match="no_header"):
        identify(EpochGate("My-Camera"), None)


def test_a_bare_picture_beside_an_identified_stream_is_refused():
    gate = EpochGate("front")
    seen(gate, header(0), at_s=10.0)
    with pytest.raises(PayloadError) as caught:
        identify(gate, None, at_s=10.0 + SILENCE_S - 0.01)
    assert caught.value.reason == "no_header"


def test_bare_pictures_follow_an_identified_stream_after_silence_as_one_epoch():
    """Even if several arrive before the first of them is decoded."""
    gate = EpochGate("front")
    seen(gate, header(0), at_s=10.0)
    first, second, third = (
        identify(gate, None, now_ns=NOW_NS + n, at_s=10.0 + SILENCE_S) for n in range(3)
    )
    assert [made_up.epoch for made_up in (first, second, third)] == [NOW_NS] * 3
    seen(gate, first, at_s=12.0)
    fourth = identify(gate, None, now_ns=NOW_NS + 3, at_s=12.0)
    assert (fourth.epoch, fourth.seq) == (NOW_NS, 3)


def test_an_identified_stream_takes_over_from_bare_pictures_which_are_then_another_epoch():
    gate = EpochGate("front")
    seen(gate, identify(gate, None), at_s=0.0)
    camera = header(0, epoch=NOW_NS + 5)
    seen(gate, camera, at_s=0.1)
    with pytest.raises(PayloadError, match="no_header"):
        identify(gate, None, at_s=0.2)
    later = identify(gate, None, now_ns=NOW_NS + 10, at_s=5.0)
    assert (later.epoch, later.seq) == (NOW_NS + 10, 0)


def test_an_identified_stream_takes_over_although_the_bare_ones_made_up_epoch_is_newer():
    gate = EpochGate("front")
    bare, waiting = identify(gate, None), identify(gate, None)
    gate.accept(bare, 0, 0)
    camera = header(7)
    assert camera.epoch < bare.epoch
    assert gate.admit(camera, 10**8)[0]
    gate.accept(camera, 10**8, 10**8)
    with pytest.raises(PayloadError, match="no_header"):  # the next, which waited in the buffer
        gate.accept(waiting, 2 * 10**8, 2 * 10**8)
