"""Region, scale and mask: the selected part of a frame, and results in pixels of the frame."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from zenoh_vision.errors import PayloadError
from zv.edge.contours import LineLimits, trace
from zv.edge.selection import selected


def test_without_a_selection_nothing_is_copied():
    picture = np.arange(12, dtype=np.uint8).reshape(3, 4)
    part = selected(picture)
    assert np.shares_memory(part.picture, picture)
    assert part.whole(picture) is picture
    assert part.masked(picture) is picture


def test_a_region_is_cut_out_and_put_back():
    picture = np.arange(20 * 30, dtype=np.uint16).astype(np.uint8).reshape(20, 30)
    part = selected(picture, box=(5, 2, 10, 8))
    assert np.array_equal(part.picture, picture[2:10, 5:15])
    expected = np.zeros((20, 30), np.uint8)
    expected[2:10, 5:15] = 255
    assert np.array_equal(part.whole(np.full((8, 10), 255, np.uint8)), expected)


def test_the_part_of_a_region_outside_of_the_frame_is_ignored():
    part = selected(np.zeros((20, 30), np.uint8), box=(25, 15, 100, 100))
    assert part.picture.shape == (5, 5)
    with pytest.raises(PayloadError, match="region_outside"):
        selected(np.zeros((20, 30), np.uint8), box=(30, 0, 10, 10))


def test_a_colour_picture_keeps_its_channels():
    part = selected(np.zeros((20, 30, 3), np.uint8), box=(0, 0, 10, 10), scale=0.5)
    assert part.picture.shape == (5, 5, 3)
    assert part.whole(np.ones((5, 5, 3), np.uint8)).shape == (20, 30, 3)


def test_a_pixel_at_half_scale_becomes_four():
    part = selected(np.zeros((4, 6), np.uint8), scale=0.5)
    found = np.zeros((2, 3), np.uint8)
    found[1, 2] = 255
    expected = np.zeros((4, 6), np.uint8)
    expected[2:4, 4:6] = 255
    assert np.array_equal(part.whole(found), expected)


def test_nothing_is_found_where_the_mask_is_black():
    mask = np.zeros((2, 2), np.uint8)
    mask[:, 1] = 255  # the right half is looked at
    part = selected(np.zeros((10, 20), np.uint8), mask=mask)
    kept = part.masked(np.full((10, 20), 255, np.uint8))
    assert not kept[:, :10].any()
    assert kept[:, 10:].all()
    cut = selected(np.zeros((10, 20), np.uint8), box=(5, 0, 10, 10), scale=0.5, mask=mask)
    kept = cut.masked(np.full((5, 5), 255, np.uint8))
    assert not kept[:, :2].any()
    assert kept[:, 3:].all()


def test_lines_of_a_scaled_region_have_the_coordinates_of_the_frame():
    """Row 10 of the part at half scale is rows 20 and 21 of the region, the middle of which is
    20.5; the region begins at 30."""
    part = selected(np.zeros((200, 300), np.uint8), box=(40, 30, 100, 80), scale=0.5)
    edges = np.zeros((40, 50), np.uint8)
    edges[10, 5:46] = 255
    cv2.circle(edges, (25, 25), 12, 255)
    found = trace(edges, LineLimits(circles=True))
    lines, ((x, y, radius),) = part.in_frame(found), found.circles
    assert lines.circles.tolist() == [pytest.approx([2 * x + 40.5, 2 * y + 30.5, 2 * radius])]
    segment = next(each for each in lines.segments if each[1] == each[3])
    assert sorted([segment[0], segment[2]]) == [40 + 10.5, 40 + 90.5]
    assert segment[1] == segment[3] == 50.5
    (line,) = (each for each in lines.polylines if not each.closed)
    assert line.length == 80
    assert np.abs(line.points[:, 1] - 50.5).max() <= 0.5
