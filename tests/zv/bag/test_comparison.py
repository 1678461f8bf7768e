"""The first field that differs between two sets of answers."""

from __future__ import annotations

import cv2
import msgpack
import numpy as np
import pytest

from tests.support.recordings import frame_header
from zv.bag.comparison import MISSING, Difference, Tolerances, first_difference
from zv.bag.record import Record

KEY = "vision/front/tracks"
TRACK = {"id": 3, "state": "confirmed", "x": 10.0, "box": [1, 2, 30, 40], "world": None}


def message(fields: dict[str, object] | None = None, key: str = KEY, **header: object) -> Record:
    whole = {"header": frame_header(5) | header, "tracks": [TRACK | (fields or {})]}
    return Record(key, msgpack.packb(whole), "application/msgpack;vision.Tracks.v1")


def differs(now: Record, tolerances: Tolerances | None = None) -> Difference | None:
    return first_difference([message()], [now], tolerances or Tolerances())


@pytest.mark.parametrize(
    ("fields", "name", "before", "after"),
    [
        ({"x": 10.5}, "tracks.0.x", 10.0, 10.5),
        ({"id": 4}, "tracks.0.id", 3, 4),
        ({"state": "lost"}, "tracks.0.state", "confirmed", "lost"),
        ({"box": (1, 2, 31, 40)}, "tracks.0.box.2", 30, 31),
        ({"box": (1, 2, 30)}, "tracks.0.box.3", 40, MISSING),
        ({"world": (1.0, 2.0)}, "tracks.0.world", None, (1.0, 2.0)),
        ({"x": True}, "tracks.0.x", 10.0, True),
        ({"x": None}, "tracks.0.x", 10.0, None),
    ],
)
def test_a_field_that_differs_is_named_with_both_values(
    fields: dict[str, object], name: str, before: object, after: object
):
    assert differs(message(fields)) == Difference(KEY, name, before, after)


def test_who_made_a_message_and_when_is_not_compared():
    assert differs(message(node="other", revision=4, received_ns=1, done_ns=2, replay=3)) is None


def test_the_identity_of_the_frame_is_compared():
    found = differs(message(seq=6))
    assert found is not None
    assert found.field == "header.seq"


def test_only_the_last_digits_of_a_float_may_differ_without_a_tolerance():
    assert differs(message({"x": 10.0 + 1e-9})) is None
    assert differs(message({"x": 10.0 + 1e-6})) is not None


@pytest.mark.parametrize(
    ("tolerances", "same"),
    [
        (Tolerances(0.5), True),
        (Tolerances(0.4), False),
        (Tolerances(by_field={"tracks.x": 0.5}), True),
        (Tolerances(by_field={"tracks": 0.5}), True),
        (Tolerances(by_field={"tracks.y": 0.5}), False),
        (Tolerances(0.1, {"tracks.x": 0.5}), True),
        (Tolerances(0.5, {"tracks.x": 0.1}), False),
        (Tolerances(ignored=frozenset({"tracks.x"})), True),
        (Tolerances(ignored=frozenset({"tracks"})), True),
    ],
)
def test_tolerances_are_of_all_floats_or_of_a_field(tolerances: Tolerances, same: bool):
    assert (differs(message({"x": 10.5}), tolerances) is None) is same


def test_a_whole_number_needs_a_tolerance_of_its_own_field():
    assert differs(message({"id": 4}), Tolerances(5.0)) is not None
    assert differs(message({"id": 4}), Tolerances(by_field={"tracks.id": 1})) is None


def test_a_message_too_few_or_too_many_is_a_difference():
    one, other = message(), message(key="vision/front/centroid")
    assert first_difference([one, other], [other, one], Tolerances()) is None
    missing = first_difference([one, other], [one], Tolerances())
    assert missing is not None
    assert (missing.key, missing.now) == (other.key, MISSING)
    extra = first_difference([one], [one, one], Tolerances())
    assert extra is not None
    assert (extra.key, extra.recorded) == (KEY, MISSING)


def picture(*white: tuple[int, int], level: int = 255) -> Record:
    pixels = np.zeros((10, 10), np.uint8)
    for row, column in white:
        pixels[row, column] = level
    return Record(
        "vision/front/edges/compressed", cv2.imencode(".png", pixels)[1].tobytes(), "image/png"
    )


def test_pictures_are_compared_by_their_pixels():
    one, other = picture((1, 1)), picture((1, 1), (2, 2))
    found = first_difference([one], [other], Tolerances())
    assert found is not None
    assert (found.field, found.now) == ("pixels", 0.01)
    assert first_difference([one], [other], Tolerances(by_field={"pixels": 0.01})) is None
    again = Record(
        one.key,
        cv2.imencode(".png", np.eye(10, dtype=np.uint8) * 0, [16, 0])[1].tobytes(),
        "image/png",
    )
    assert first_difference([picture()], [again], Tolerances()) is None  # other bytes
