"""Faults on demand: how they are written, and which frames have them."""

from __future__ import annotations

import pytest

from zenoh_vision.error_text import shortened
from zv.camera.synthetic.faults import Fault, fault_at, parse_faults


def test_a_fault_reads_as_kind_at_frame_plus_frames() -> None:
    assert parse_faults("stall@90+60") == (Fault("stall", at=90, frames=60),)


def test_several_faults_are_separated_by_commas_and_keep_their_order() -> None:
    assert parse_faults(" lighting@300+1 ,stall@0+5,drop@7+2, frozen@20+30") == (
        Fault("lighting", 300, 1),
        Fault("stall", 0, 5),
        Fault("drop", 7, 2),
        Fault("frozen", 20, 30),
    )


@pytest.mark.parametrize("text", ["", "  "])
def test_no_text_is_no_fault(text: str) -> None:
    assert parse_faults(text) == ()


@pytest.mark.parametrize(
    "text",
    [
        "stall",
        "stall@90",
        "stall+60",
        "stall@+60",
        "stall@90+",
        "stall@90+60+1",
        "stall@-1+60",
        "stall@9.5+60",
        "stall@x+60",
        "@90+60",
        "Stall@90+60",
        "fire@90+60",
        "stall@90+0",
        "stall@90+60s",
        "stall@٣+60",
        "stall@" + "9" * 5000 + "+1",
        "stall@1000000+1",
        "drop@now+1000000",
        "drop@now+999999999999999999",
        "stall@now",
        "stall@Now+1",
    ],
)
def test_wrong_text_is_refused_with_what_was_wrong_and_the_form(text: str) -> None:
    with pytest.raises(ValueError, match="expected KIND@FRAME") as refusal:
        parse_faults(f"drop@1+1,{text}")
    assert shortened(text) in str(refusal.value)
    assert "stall frozen drop lighting" in str(refusal.value)


def test_the_highest_numbers_are_hours_and_not_ages() -> None:
    assert parse_faults("stall@999999+0999999") == (Fault("stall", 999_999, 999_999),)


def test_a_comma_too_many_is_refused() -> None:
    with pytest.raises(ValueError, match="fault '': expected"):
        parse_faults("stall@90+60,")


def test_a_fault_from_now_on_begins_with_the_frame_it_is_set_before() -> None:
    (fault,) = parse_faults("drop@now+3")
    assert fault == Fault("drop", None, 3)
    assert fault.from_frame(7) == Fault("drop", 7, 3)
    assert Fault("drop", 2, 3).from_frame(7) == Fault("drop", 2, 3)


def test_a_fault_covers_its_first_frame_and_exactly_so_many() -> None:
    fault = Fault("frozen", at=3, frames=2)
    assert [k for k in range(10) if fault.covers(k)] == [3, 4]
    assert fault.end == 5


def test_the_first_listed_fault_of_the_wanted_kinds_counts() -> None:
    faults = parse_faults("lighting@0+100,drop@5+10,stall@5+3")
    assert fault_at(faults, 6, ("stall", "drop")) == Fault("drop", 5, 10)
    assert fault_at(faults, 6, ("stall",)) == Fault("stall", 5, 3)
    assert fault_at(faults, 8, ("stall",)) is None
