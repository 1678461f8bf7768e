"""Objects that touch are cut from each other, and single ones stay whole."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from zv.tracker.foreground.concavities import cut_at_concavities

Points = list[tuple[float, float]]


def mask_of(*outlines: Points) -> np.ndarray:
    """Return a mask, 120x100, in which polygons are filled."""
    mask = np.zeros((100, 120), np.uint8)
    for outline in outlines:
        cv2.fillPoly(mask, [np.rint(outline).astype(np.int32)], (255,))
    return mask


def disc(x: float, y: float, radius: float) -> Points:
    angles = np.arange(48) * 2 * np.pi / 48
    return [(x + radius * np.cos(angle), y + radius * np.sin(angle)) for angle in angles]


def rectangle(x: float, y: float, width: float, height: float, degrees: float = 0) -> Points:
    return [*map(tuple, cv2.boxPoints(((x, y), (width, height), degrees)).tolist())]


def parts_of(mask: np.ndarray) -> list[tuple[float, float, int]]:
    """Return the middle and the area of each part, from left to right and from top to bottom."""
    _, _, boxes, middles = cv2.connectedComponentsWithStats(cut_at_concavities(mask, 40))
    parts = [(x, y, int(box[4])) for (x, y), box in zip(middles[1:], boxes[1:], strict=True)]
    return sorted(parts)


TOUCHING = {
    "discs, side by side": (disc(40, 50, 14), disc(68, 50, 14)),
    "discs, one above the other": (disc(59, 30, 12), disc(60, 59, 17)),
    "a box and a disc": (rectangle(40, 50, 34, 26), disc(70, 52, 13)),
    "boxes with flush sides": (rectangle(50, 35, 32, 22), rectangle(55, 57, 28, 22)),
    "a corner and a disc": (rectangle(40, 50, 28, 28, 45), disc(73, 50, 14)),
}


@pytest.mark.parametrize("name", TOUCHING)
def test_two_convex_objects_that_touch_are_two_parts(name: str):
    alone = [parts_of(mask_of(outline))[0] for outline in TOUCHING[name]]
    found = parts_of(mask_of(*TOUCHING[name]))
    assert len(found) == 2
    for (x, y, area), (x2, y2, area2) in zip(found, sorted(alone), strict=True):
        assert (x, y) == pytest.approx((x2, y2), abs=2)
        assert area == pytest.approx(area2, rel=0.15)


def test_three_in_a_row_are_three_parts():
    row = mask_of(disc(25, 50, 13), rectangle(55, 50, 34, 24), disc(85, 50, 13))
    assert [x for x, _, _ in parts_of(row)] == pytest.approx([25, 55, 85], abs=2)


def test_two_touching_boxes_that_are_flush_at_one_side_are_two_parts():
    flush = mask_of(rectangle(50, 35, 40, 22), rectangle(44, 57, 28, 22))
    assert len(parts_of(flush)) == 2


@pytest.mark.parametrize("degrees", range(0, 90, 9))
def test_a_single_object_with_a_rough_edge_is_one_part(degrees: int):
    rng = np.random.default_rng(degrees)
    for outline in (rectangle(60, 50, 60, 24, degrees), disc(60, 50, 10 + degrees / 6)):
        mask = mask_of(outline)
        edge = cv2.morphologyEx(mask, cv2.MORPH_GRADIENT, np.ones((3, 3), np.uint8)) > 0
        mask[edge & (rng.random(mask.shape) < 0.5)] = 255
        mask = cv2.medianBlur(mask, 3)  # as the foreground is
        assert len(parts_of(mask)) == 1


def test_what_touches_nothing_is_not_copied():
    mask = mask_of(disc(30, 30, 12), rectangle(80, 60, 30, 20, 20))
    assert cut_at_concavities(mask, 40) is mask
