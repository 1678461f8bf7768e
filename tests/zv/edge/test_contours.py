"""Drawn lines are traced as the polylines, segments and circles that they are."""

from __future__ import annotations

from itertools import pairwise

import cv2
import numpy as np
import pytest

from zv.edge.contours import LineLimits, trace

LIMITS = LineLimits(min_length=5)


def drawn(*lines: tuple[tuple[int, int], ...], shape: tuple[int, int] = (100, 120)) -> np.ndarray:
    picture = np.zeros(shape, np.uint8)
    for line in lines:
        for start, end in pairwise(line):
            cv2.line(picture, start, end, 255)
    return picture


def box(left: int, top: int, right: int, bottom: int) -> tuple[tuple[int, int], ...]:
    return (left, top), (right, top), (right, bottom), (left, bottom), (left, top)


@pytest.mark.parametrize("end", [(90, 20), (90, 60), (40, 90), (10, 90), (30, 40)])
def test_an_open_line_is_traced_from_end_to_end(end: tuple[int, int]):
    (line,) = (found := trace(drawn(((10, 20), end)), LIMITS)).polylines
    assert not line.closed
    assert {tuple(line.points[0]), tuple(line.points[-1])} == {(10, 20), end}
    assert found.omitted == 0
    if end == (90, 20):
        assert (len(line.points), line.length) == (2, 80)
        assert {tuple(each) for each in found.segments.reshape(2, 2)} == {(10, 20), end}


def test_a_bent_line_has_a_point_at_its_corner():
    (line,) = trace(drawn(((10, 20), (50, 20), (50, 70))), LIMITS).polylines
    assert len(line.points) in (3, 4)
    assert np.abs(line.points[len(line.points) // 2] - (50, 20)).max() <= 1
    assert line.length == pytest.approx(90, abs=2)


@pytest.mark.parametrize(
    ("shown", "lengths", "closed"),
    [
        pytest.param([box(20, 20, 80, 60)], [200], True, id="a closed line"),
        pytest.param([box(10, 10, 110, 90), box(40, 40, 80, 60)], [360, 120], True, id="nested"),
        pytest.param(
            [((10, 50), (110, 50)), ((60, 10), (60, 90))], [48, 48, 38, 38], False, id="a crossing"
        ),
    ],
)
def test_lines_are_cut_where_they_meet_and_closed_ones_are_traced_once(
    shown: list, lengths: list[int], closed: bool
):
    found = trace(drawn(*shown), LIMITS)
    assert [line.length for line in found.polylines] == pytest.approx(lengths, abs=5)
    assert {line.closed for line in found.polylines} == {closed}
    assert len(found.segments) == 4 * len(shown) - 4 * (not closed)


def test_a_staircase_is_one_line():
    """Suppression leaves corners on slanted lines; each would look like a meeting of lines."""
    stairs = np.zeros((60, 60), np.uint8)
    for place in range(10, 50):
        stairs[place, place] = stairs[place, place + 1] = 255
    (line,) = trace(stairs, LIMITS).polylines
    assert line.length == pytest.approx(39 * 2**0.5, abs=2)


def test_the_longest_come_first_and_the_number_is_bounded():
    lines = [((10, 5 * row), (10 + 10 * row, 5 * row)) for row in range(1, 10)]
    found = trace(drawn(*lines), LineLimits(max_count=3, min_length=25))
    assert [line.length for line in found.polylines] == [90, 80, 70]
    assert found.omitted == 4  # 60 to 30; those of 20 and 10 are too short
    assert len(found.segments) == 3


def test_a_polyline_stays_within_its_tolerance():
    picture = np.zeros((200, 200), np.uint8)
    cv2.circle(picture, (100, 100), 70, 255)
    for tolerance in (0.5, 1.0, 3.0):
        limits = LineLimits(tolerance=tolerance, min_length=5)
        lines = trace(picture, limits).polylines
        for line in lines:
            distances = np.abs(np.hypot(*(line.points - 100).T) - 70)
            assert distances.max() < 1
    assert len(lines[0].points) < 40


@pytest.mark.parametrize("radius", [8, 25, 40])
def test_a_circle_has_its_centre_and_radius(radius: int):
    """The pixels that OpenCV draws are up to 0.55 inside of the circle."""
    picture = drawn(((5, 5), (60, 5)), ((5, 95), (100, 90)), shape=(100, 120))
    cv2.circle(picture, (60, 50), radius, 255)
    found = trace(picture, LineLimits(min_length=5, circles=True)).circles
    assert found.tolist() == [pytest.approx([60, 50, radius], abs=0.6)]
    assert trace(picture, LIMITS).circles is None


def test_a_short_arc_and_a_square_are_no_circles():
    picture = np.zeros((100, 120), np.uint8)
    cv2.ellipse(picture, (60, 50), (40, 40), 0, 0, 100, 255)
    cv2.rectangle(picture, (10, 60), (40, 90), 255)
    limits = LineLimits(min_length=5, circles=True)
    assert len(trace(picture, limits).circles) == 0
    most = np.zeros((100, 120), np.uint8)
    cv2.ellipse(most, (60, 50), (40, 40), 0, 0, 230, 255)  # is one
    assert trace(most, limits).circles.tolist() == [pytest.approx([60, 50, 40], abs=0.8)]


@pytest.mark.parametrize("shape", [(1, 1), (1, 50), (50, 1), (30, 40)], ids=str)
def test_any_map_can_be_traced(shape: tuple[int, int]):
    for picture in (np.zeros(shape, np.uint8), np.full(shape, 255, np.uint8)):
        found = trace(picture, LineLimits(min_length=0, circles=True))
        assert len(found.polylines) <= 100
    noise = np.where(np.random.default_rng(1).random(shape) < 0.3, 255, 0).astype(np.uint8)
    before = noise.copy()
    for line in trace(noise, LineLimits(min_length=0)).polylines:
        assert (line.points >= 0).all()
        assert (line.points < shape[::-1]).all()
        assert noise[line.points[:, 1], line.points[:, 0]].all()
    assert np.array_equal(noise, before)
