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


def test_a_straight_line_has_two_points_and_one_segment():
    (line,) = (found := trace(drawn(((10, 20), (90, 20))), LIMITS)).polylines
    assert sorted(map(tuple, line.points.tolist())) == [(10, 20), (90, 20)]
    assert (line.length, line.closed) == (80, False)
    assert sorted([found.segments[0, :2].tolist(), found.segments[0, 2:].tolist()]) == [
        [10, 20],
        [90, 20],
    ]
    assert found.omitted == 0


@pytest.mark.parametrize("end", [(90, 20), (90, 60), (40, 90), (10, 90), (30, 40)])
def test_an_open_line_is_traced_from_end_to_end(end: tuple[int, int]):
    (line,) = trace(drawn(((10, 20), end)), LIMITS).polylines
    assert not line.closed
    ends = {tuple(line.points[0]), tuple(line.points[-1])}
    assert ends == {(10, 20), end}


def test_a_bent_line_has_a_point_at_its_corner():
    (line,) = trace(drawn(((10, 20), (50, 20), (50, 70))), LIMITS).polylines
    middle = line.points[len(line.points) // 2]
    assert len(line.points) in (3, 4)
    assert np.abs(middle - (50, 20)).max() <= 1
    assert line.length == pytest.approx(90, abs=2)


def test_a_closed_line_is_traced_once_and_marked_as_closed():
    corners = ((20, 20), (80, 20), (80, 60), (20, 60), (20, 20))
    (line,) = (found := trace(drawn(corners), LIMITS)).polylines
    assert line.closed
    assert line.length == pytest.approx(200, abs=5)
    assert len(found.segments) == 4


def test_a_closed_line_inside_of_another_is_found_too():
    outer = ((10, 10), (110, 10), (110, 90), (10, 90), (10, 10))
    inner = ((40, 40), (80, 40), (80, 60), (40, 60), (40, 40))
    lines = trace(drawn(outer, inner), LIMITS).polylines
    assert [line.closed for line in lines] == [True, True]
    assert lines[0].length > lines[1].length


def test_lines_are_cut_where_they_meet():
    lines = trace(drawn(((10, 50), (110, 50)), ((60, 10), (60, 90))), LIMITS).polylines
    assert len(lines) == 4
    assert [line.length for line in lines] == pytest.approx([48, 48, 38, 38], abs=2)


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
    assert len(trace(picture, LineLimits(min_length=5, circles=True)).circles) == 0


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
