"""The pictures of the belt show what their truth says."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from tests.support.pictures.belt import Belt
from tests.support.pictures.belt_objects import COLOURS

DISTORTION = (-0.22, 0.06, 0.001, -0.0008, 0.0)


@pytest.fixture(scope="module")
def belt() -> Belt:
    return Belt(320, 240, number=12, noise=0, distortion=DISTORTION)


def test_a_picture_shows_each_object_at_its_position(belt: Belt):
    time_s = belt.crossing_s(5, 400)
    shown = belt.picture_at(time_s).astype(int)
    boxes = belt.boxes(time_s)
    alone = [one for one in belt.objects if one.id in boxes and one.touches is None]
    assert 5 in boxes
    assert alone
    for one in alone:
        left, top, width, height = boxes[one.id]
        x, y = int(left) - 2, int(top) - 2
        part = shown[y : y + int(height) + 5, x : x + int(width) + 5]
        # The belt is grey, around 62 in each channel; the colours are at least 30 away from it.
        seen = (np.abs(part - 62).max(axis=2) > 15).astype(np.uint8)
        found = cv2.boundingRect(seen)
        assert (found[0] + x, found[1] + y) == pytest.approx((left, top), abs=1.2)
        assert found[2:] == pytest.approx((width + 1, height + 1), abs=1.8)
        (centre,) = belt.to_pixels(np.array([[one.along_mm + 150 * time_s, one.y_mm]]))
        colour = shown[round(centre[1]), round(centre[0])]
        # The middle of an object is its label, three quarters as bright as the rest.
        assert colour == pytest.approx(np.array(one.colour) * 0.75, abs=30)


def test_pixels_millimetres_and_times_correspond(belt: Belt):
    pixels = np.array([[40, 60], [200, 110], [300, 200]], np.float64)
    assert belt.to_pixels(belt.to_mm(pixels)) == pytest.approx(pixels, abs=1e-6)
    # Without distortion the first corner of the belt is where the layout puts it.
    corner = Belt(101, 101, number=6).to_pixels(np.array([[0.0, 0.0]]))
    assert corner[0] == pytest.approx((6, 84), abs=1e-4)
    time_s = belt.crossing_s(3, 250)
    assert belt.positions(time_s)[2].x_mm == pytest.approx(250)
    assert belt.positions(time_s - 0.1)[2].x_mm == pytest.approx(250 - 15)  # 150 mm/s


def test_thirty_objects_hold_five_touching_pairs():
    belt = Belt()
    assert [one.id for one in belt.objects] == list(range(1, 31))
    pairs = {(one.id, one.touches) for one in belt.objects if one.touches}
    assert len(pairs) == 10
    assert pairs == {(b, a) for a, b in pairs}
    outlines = {one.id: one.outline_mm + np.array([one.along_mm, one.y_mm]) for one in belt.objects}
    for a, outline in outlines.items():
        for b, other in outlines.items():
            if a < b:
                apart = np.hypot(*(outline[:, None] - other[None]).transpose(2, 0, 1)).min()
                gap = signed_gap(outline, other)
                assert (-0.5 < gap < 0.5) if (a, b) in pairs else (apart > 20), (a, b)
    colours = [one.colour for one in belt.objects]
    assert set(colours) <= set(COLOURS)
    assert all(belt.objects[b - 1].colour != belt.objects[a - 1].colour for a, b in pairs)


def signed_gap(one: np.ndarray, other: np.ndarray) -> float:
    """Return the gap between convex outlines by separating axes; negative if they overlap."""
    gaps = []
    for outline in (one, other):
        edges = np.roll(outline, -1, axis=0) - outline
        for normal in np.stack([edges[:, 1], -edges[:, 0]], 1):
            axis = normal / np.hypot(*normal)
            a, b = one @ axis, other @ axis
            gaps.append(max(a.min() - b.max(), b.min() - a.max()))
    return max(gaps)
