"""Queries for predictions: replies, and refusals with the allowed values."""

from __future__ import annotations

import re
import time
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import pytest

from zenoh_vision import Header, ParameterRefused, Prediction
from zenoh_vision.calibration.camera_model import CameraModel
from zenoh_vision.calibration.plane import Plane
from zenoh_vision.calibration.plane_view import PlaneView
from zv.tracker.prediction.answers import PredictionAnswers
from zv.tracker.prediction.paths import NOISE_PX
from zv.tracker.tracking.track import Track

NOW_NS = 1_700_000_000_000_000_000
FRAME_NS = 100_000_000
LENS = CameraModel(640, 480, (500.0, 0, 319.5, 0, 500, 239.5, 0, 0, 1))
VIEW = PlaneView(LENS, Plane((0.01, 0, 0, 0, 0.01, 0, 0, 0, 1)))


class StandIn:
    """The part of a node that ``PredictionAnswers`` uses."""

    def answer(self, topic: Any, reply_to: Callable[..., Any], *, camera: str) -> None:
        """Keep the callback that answers."""
        self.reply_to = reply_to


def moving(frame: int, id_: int = 7, state: Any = "confirmed") -> Track:
    """Return a track that moves right by 10 pixels a frame, 100 a second."""
    x = 100.0 + 10 * frame
    return Track(id_, state, x, 50.0, (round(x) - 10, 40, 20, 30), 500.0, steady=(x, 50.0))


def header(frame: int, epoch: int = 1, newest_ns: int = NOW_NS) -> Header:
    stamp_ns = newest_ns + (frame - 9) * FRAME_NS
    return Header(camera="front", epoch=epoch, seq=frame, stamp_ns=stamp_ns, width=640, height=480)


def followed(view: PlaneView | None = VIEW, anchor: Any = "centre", **options: Any) -> Any:
    """Return the answers to queries after ten frames with track 7."""
    answers = PredictionAnswers(StandIn(), "front")  # type: ignore[arg-type]
    for frame in range(10):
        answers.update(header(frame, **options), [moving(frame)], anchor, view)
    return answers


def test_a_track_is_predicted_in_a_straight_line_on_the_plane():
    found: Prediction = followed().answer({"id": "7", "at_ns": str(NOW_NS + 500_000_000)})
    assert (found.id, found.state, found.stamp_ns) == (7, "confirmed", NOW_NS + 500_000_000)
    assert (found.x, found.y, found.vx) == pytest.approx((240, 50, 100), abs=1e-3)
    assert found.world == pytest.approx((2.395, 0.495))  # pixels count from their middles there
    assert found.world_velocity == pytest.approx((1, 0), abs=1e-6)
    assert found.sigma[0] >= NOISE_PX
    assert found.world_sigma == pytest.approx([each / 100 for each in found.sigma], rel=1e-3)
    assert found.header.seq == 9
    assert Prediction.from_bytes(found.to_bytes()) == found


def test_a_world_position_is_that_of_the_anchor_and_a_pixel_position_that_of_the_centre():
    found = followed(anchor="foot").answer({"id": "7", "at_ns": str(NOW_NS)})
    assert found.world == pytest.approx((1.895, 0.695))
    assert (found.x, found.y) == pytest.approx((190, 50), abs=1e-3)


def test_without_a_plane_a_track_is_predicted_in_the_picture():
    found = followed(view=None).answer({"id": "7", "at_ns": str(NOW_NS + 500_000_000)})
    assert (found.x, found.y) == pytest.approx((240, 50))
    assert (found.world, found.world_velocity, found.world_sigma) == (None, None, None)


def test_ahead_ms_counts_from_now():
    now_ns = time.time_ns()
    found = followed(newest_ns=now_ns).answer({"id": "7", "ahead_ms": "1000"})
    assert 0 <= found.stamp_ns - now_ns - 1_000_000_000 < 5_000_000_000
    assert found.x == pytest.approx(190 + 100 * (found.stamp_ns - now_ns) / 1e9, abs=0.01)


def test_a_lost_track_is_predicted_from_its_last_seen_position():
    answers = followed()
    lost = Track(7, "lost", 300.0, 50.0, (290, 40, 20, 30), 500.0, missing_s=0.1)
    answers.update(header(10), [lost], "centre", VIEW)
    found = answers.answer({"id": "7", "at_ns": str(NOW_NS + 200_000_000)})
    assert found.state == "lost"
    assert found.x == pytest.approx(210, abs=1e-3)


@pytest.mark.parametrize(
    ("asked", "error", "allowed"),
    [
        ({}, "id is missing", "id, and ahead_ms or at_ns"),
        ({"id": "7"}, "either ahead_ms or at_ns", "id, and ahead_ms or at_ns"),
        ({"id": "7", "ahead_ms": "1", "at_ns": "1"}, "either", "id, and"),
        ({"id": "x", "ahead_ms": "1"}, "id = 'x'", "whole number"),
        ({"id": "-7", "ahead_ms": "1"}, "id = '-7'", "whole number"),
        ({"id": "7", "ahead_ms": "1.5"}, "ahead_ms = '1.5'", "milliseconds, a whole number"),
        ({"id": "7", "ahead_ms": "9" * 100}, "ahead_ms = '999", "from 0 to 10000"),
        ({"id": "7", "at_ns": "nan"}, "at_ns = 'nan'", "nanoseconds since 1970"),
        ({"id": "7", "at_ns": str(NOW_NS - 1)}, "s from the newest frame", f"from {NOW_NS} to"),
        ({"id": "7", "at_ns": str(NOW_NS + 11 * 10**9)}, r"\+11.000 s from", "up to 10 s"),
        ({"id": "8", "at_ns": "1"}, "no track 8 now", "^7$"),
        ({"id": "7", "ahead": "1"}, "unknown parameter 'ahead'", "id, and ahead_ms or at_ns"),
    ],
)
def test_an_invalid_query_is_refused_with_the_allowed_values(
    asked: Mapping[str, str], error: str, allowed: str
):
    with pytest.raises(ParameterRefused, match=error) as caught:
        followed().answer(asked)
    assert re.search(allowed, caught.value.allowed)


def test_a_new_track_and_a_new_epoch_have_no_prediction_yet():
    answers = followed()
    answers.update(header(10), [moving(10), moving(10, 8)], "centre", VIEW)
    with pytest.raises(ParameterRefused, match="track 8 was seen in 1 frames only"):
        answers.answer({"id": "8", "at_ns": str(NOW_NS + FRAME_NS)})
    answers.update(header(11, epoch=2), [moving(11)], "centre", VIEW)
    with pytest.raises(ParameterRefused, match="track 7 was seen in 1 frames only"):
        answers.answer({"id": "7", "at_ns": str(NOW_NS + 2 * FRAME_NS)})


def test_an_ended_track_has_no_prediction():
    answers = followed()
    answers.update(header(10), [], "centre", VIEW)
    with pytest.raises(ParameterRefused, match="no track 7 now; allowed: none is followed now"):
        answers.answer({"id": "7", "at_ns": str(NOW_NS + FRAME_NS)})


def test_before_the_first_frame_there_are_no_tracks_to_predict():
    answers = PredictionAnswers(StandIn(), "front")  # type: ignore[arg-type]
    with pytest.raises(ParameterRefused, match="none is followed now"):
        answers.answer({"id": "7", "ahead_ms": "1"})


def test_a_trail_has_the_measured_centres_of_the_last_three_seconds():
    answers = PredictionAnswers(StandIn(), "front")  # type: ignore[arg-type]
    assert answers.trails() == {}
    for second in range(5):
        found = moving(second)
        lost = replace(found, state="lost", steady=None, missing_s=1.0)
        answers.update(header(10 * second), [lost if second == 3 else found], "centre", None)
    assert answers.trails() == {7: [(110, 50), (120, 50), (140, 50)]}
    answers.update(header(50), [moving(9, id_=8)], "centre", None)
    assert answers.trails() == {8: [(190, 50)]}
