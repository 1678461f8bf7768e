"""Centroids and tracks on a picture: where the marks are, and that the picture is left alone."""

from __future__ import annotations

import numpy as np

from zenoh_vision.messages import Centroid, Header, Track, Tracks
from zv.tools.shared.drawing import COLOURS, GREEN, draw

HEADER = Header(camera="front", epoch=1, seq=2, stamp_ns=3, width=320, height=240)
BLACK = np.zeros((240, 320, 3), np.uint8)


def box_of(picture, colour) -> tuple[int, int, int, int]:
    """Return what the pixels of a colour span, below the labels."""
    rows, columns = np.nonzero((picture == colour).all(axis=2))
    return columns.min(), rows.min(), columns.max(), rows.max()


def test_a_centroid_has_its_box_and_its_dot_and_the_picture_is_not_touched():
    centroid = Centroid(header=HEADER, x=150, y=120, box=(100, 80, 100, 80), area=10.0)
    picture = draw(BLACK, centroid)
    assert not BLACK.any()
    for x, y in ((100, 100), (200, 100), (150, 160), (150, 120)):  # left, right, bottom, dot
        assert tuple(picture[y, x]) == GREEN, (x, y)
    assert not picture[140, 110:190].any()  # inside the box, beside the dot
    assert picture[66:79, 100:200].any()  # the label stands above it


def test_when_nothing_moves_nothing_is_drawn():
    nothing = Centroid(header=HEADER, x=None, y=None, box=None, area=None)
    assert not draw(BLACK, nothing).any()


def test_on_a_smaller_picture_the_marks_are_scaled():
    centroid = Centroid(header=HEADER, x=150, y=120, box=(100, 80, 100, 80), area=10.0)
    small = draw(np.zeros((120, 160, 3), np.uint8), centroid)
    for x, y in ((50, 60), (100, 60), (75, 80), (75, 60)):
        assert tuple(small[y, x]) == GREEN, (x, y)


def test_each_track_has_a_colour_of_its_own():
    tracks = Tracks(
        header=HEADER,
        tracks=tuple(
            Track(id=index, state="confirmed", x=x + 20, y=150, box=(x, 130, 40, 40), area=1.0)
            for index, x in ((1, 30), (2, 130))
        ),
    )
    picture = draw(BLACK, tracks)
    for index, x in ((1, 30), (2, 130)):
        assert tuple(picture[150, x]) == COLOURS[index]
        assert tuple(picture[150, x + 20]) == COLOURS[index]
    assert box_of(picture, COLOURS[1])[2] < 100 < box_of(picture, COLOURS[2])[0]


def test_a_box_beyond_the_edges_does_no_harm():
    centroid = Centroid(
        header=HEADER, x=0, y=0, box=(-(2**31), -50, 2**31 - 1, 2**31 - 1), area=1.0
    )
    assert draw(BLACK, centroid).shape == BLACK.shape
