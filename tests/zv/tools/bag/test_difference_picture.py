"""What is drawn of two results that differ."""

from __future__ import annotations

import math

import pytest

from zv.tools.bag.difference_picture import shapes_in


@pytest.mark.parametrize("wrong", [math.nan, math.inf, True, "1", None])
def test_what_is_no_place_is_not_drawn(wrong: object) -> None:
    tracks = ({"x": 1, "y": wrong, "box": (1, 2, 3, 4)}, {"x": 1, "y": 2, "box": (1, 2, 3, wrong)})
    assert list(shapes_in({"tracks": tracks})) == [((1, 2, 3, 4), None), (None, (1.0, 2.0))]
