"""A wrong value as an error shows it."""

from __future__ import annotations

from typing import Any

import pytest

from zenoh_vision.error_text import joined, shortened


@pytest.mark.parametrize(
    ("value", "shown"),
    [
        ("kraken", "'kraken'"),
        ("a" * 80, repr("a" * 80)),
        ("a" * 81, repr("a" * 60) + "... (81 characters)"),
        (1.5, "1.5"),
        (None, "None"),
    ],
    ids=["short", "just short enough", "too long", "number", "nil"],
)
def test_a_value_is_shown_whole_unless_it_is_long(value, shown):
    assert shortened(value) == shown


def test_a_list_is_shown_in_a_line_however_long_and_deep_it_is():
    deep: list[Any] = []
    for _ in range(10_000):
        deep = [deep]
    assert len(shortened(deep)) < 100
    assert len(shortened(list(range(1000)))) < 100


def test_names_are_listed_up_to_a_number_and_the_rest_is_counted():
    assert joined([], 2) == ""
    assert joined(["a", "b"], 2) == "a, b"
    assert joined(["a", "b", "c", "d"], 2) == "a, b and 2 more"
