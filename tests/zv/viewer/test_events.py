"""Values as the page's JSON texts carry them."""

import pytest

from zv.viewer.events import plain


@pytest.mark.parametrize(
    ("value", "wanted"),
    [
        ({"a_ns": 5, "epoch": 6, "seq": 7}, {"a_ns": "5", "epoch": "6", "seq": 7}),
        ({"area": 2**53 - 1}, {"area": 2**53 - 1}),
        ({"id": 2**53}, {"id": str(2**53)}),
        ({"id": -(2**60)}, {"id": str(-(2**60))}),
        ({"x": float("nan"), "y": float("inf")}, {"x": None, "y": None}),
        ({"on": True, "none": None}, {"on": True, "none": None}),
        ({"box": (1, 2, 2**60)}, {"box": [1, 2, str(2**60)]}),
        ({"raw": b"abc"}, {"raw": "3 bytes"}),
    ],
)
def test_numbers_survive_javascript(value, wanted):
    assert plain(value) == wanted
