"""What is said of a certificate out of its time."""

from __future__ import annotations

from pathlib import Path

import pytest

from zenoh_vision.security.credentials import Validity, without_clock

BEGINS_S, ENDS_S = 1_000_000_000.0, 1_000_086_400.0


@pytest.mark.parametrize("now_s", [BEGINS_S - 600, ENDS_S + 600])
def test_a_minute_later_nothing_new_is_said(now_s: float):
    own = Validity("guest", Path(), BEGINS_S, ENDS_S)
    said, later = own.fault(now_s), own.fault(now_s + 60)
    assert said != later
    assert without_clock(said) == without_clock(later)
    other = own.fault(ENDS_S + 600 if now_s < BEGINS_S else BEGINS_S - 600)
    assert without_clock(said) != without_clock(other)
