"""What a page may ask, and how often."""

from __future__ import annotations

import json

import pytest

from services.viewer.requests import (
    MAX_RATE_HZ,
    MAX_SHOWN_HZ,
    Malformed,
    Quota,
    Request,
    request_of,
)

SHOWN = json.dumps({"op": "shown", "key": "vision/front/image/compressed"})


def asked(text: str) -> Request | Malformed:
    try:
        return request_of(text)
    except Malformed as error:
        return error


@pytest.mark.parametrize(
    "text",
    [
        '{"op":"unwatch","key":"a"}',
        '{"op":"unwatch","key":"shown"}',
        '{"op":"unwatch","key":"a","note":"shown"}',
        '{"op":"shown"}',  # no key
        '"shown"',
        "{",
    ],
)
def test_at_most_50_a_second_whatever_words_are_in_them(text: str):
    quota = Quota()
    assert [quota.is_exceeded(asked(text), 7.0) for _ in range(MAX_RATE_HZ + 1)] == [
        *[False] * MAX_RATE_HZ,
        True,
    ]
    assert not quota.is_exceeded(asked(text), 8.5)


def test_that_a_picture_is_shown_may_be_said_more_often_and_counts_for_nothing_else():
    quota = Quota()
    shown = asked(SHOWN)
    assert not any(quota.is_exceeded(shown, 7.0) for _ in range(MAX_SHOWN_HZ))
    assert not quota.is_exceeded(asked("{"), 7.0)
    assert quota.is_exceeded(shown, 7.0)
