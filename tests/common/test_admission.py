"""Which arrivals may be seen: each at most once, never after a newer one."""

from __future__ import annotations

import pytest

from common.admission import SILENCE_S, Admission
from common.errors import PayloadError
from common.messages import Header
from tests.common.arrivals import header, seen


def refusal(admission: Admission, found: Header, at_s: float = 0.0) -> str:
    with pytest.raises(PayloadError) as caught:
        admission.admit(found, at_s)
    return caught.value.reason


def test_frames_in_order_are_admitted_and_gaps_counted():
    admission = Admission("front")
    assert admission.admit(header(5), 0.0) == (True, 0)  # joined late: nothing was missed
    admission.accept(header(5), 0.0)
    assert admission.admit(header(6), 0.0) == (False, 0)
    assert admission.admit(header(9), 0.0) == (False, 2)  # 7 and 8
    assert admission.admit(header(10), 0.0) == (False, 0)


@pytest.mark.parametrize("seq", [0, 4, 5], ids=["much older", "older", "the same again"])
def test_a_frame_that_is_not_newer_is_refused(seq: int):
    admission = Admission("front")
    seen(admission, header(5))
    assert refusal(admission, header(seq)) == "out_of_order"


def test_a_frame_overtaken_while_it_was_decoded_is_refused():
    admission = Admission("front")
    seen(admission, header(0))
    admission.admit(header(1), 0.0)
    admission.admit(header(2), 0.0)
    admission.accept(header(2), 0.0)
    with pytest.raises(PayloadError, match="frame 1 after 2"):
        admission.accept(header(1), 0.0)


def test_a_frame_admitted_but_never_seen_does_not_close_the_door():
    admission = Admission("front")
    seen(admission, header(0))
    admission.admit(header(7), 0.0)  # could not be decoded
    assert admission.admit(header(1), 0.0) == (False, 0)


def test_a_newer_epoch_takes_over_only_with_a_frame_that_is_seen():
    admission = Admission("front")
    seen(admission, header(5, epoch=100))
    assert admission.admit(header(0, epoch=200), 0.0) == (True, 0)
    assert admission.admit(header(6, epoch=100), 0.0) == (False, 0)  # still the proven one
    admission.accept(header(0, epoch=200), 0.0)
    assert refusal(admission, header(7, epoch=100)) == "out_of_order"
    assert admission.admit(header(1, epoch=200), 0.0) == (False, 0)


def test_challengers_that_arrived_during_the_first_decode_are_not_missed():
    admission = Admission("front")
    for seq in (0, 1, 2):
        admission.admit(header(seq), 0.0)
    admission.accept(header(0), 0.0)
    assert admission.admit(header(3), 0.0) == (False, 0)
    assert admission.admit(header(5), 0.0) == (False, 1)


def test_challengers_of_another_epoch_do_not_count_as_arrived():
    admission = Admission("front")
    admission.admit(header(0, epoch=200), 0.0)
    admission.admit(header(50, epoch=100), 0.0)
    admission.accept(header(0, epoch=200), 0.0)
    assert admission.admit(header(2, epoch=200), 0.0) == (False, 1)


def test_an_older_epoch_follows_only_after_silence():
    """A camera that was started again while its clock was set back."""
    admission = Admission("front")
    seen(admission, header(5, epoch=200), at_s=10.0)
    assert refusal(admission, header(0, epoch=100), at_s=10.0 + SILENCE_S - 0.01) == "out_of_order"
    seen(admission, header(0, epoch=100), at_s=10.0 + SILENCE_S)
    assert admission.admit(header(1, epoch=100), 12.1) == (False, 0)
