"""Counts objects on the synthetic belt that cross a line, against the exact times."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import linear_sum_assignment

from benchmarks.quality.tracker.sequence import Box, Shot, Shots
from tests.support.pictures.belt import Belt

LINE_MM = 400.0
LATEST_S = 0.4
FARTHEST_MM = 30.0


@dataclass(frozen=True)
class Crossing:
    """One crossing of the line X = ``LINE_MM``: the belt's time, and Y."""

    time_s: float
    y_mm: float


@dataclass(frozen=True)
class Counts:
    """How often the objects of a belt were counted.

    Attributes:
        objects: Number of objects that crossed the line.
        once: Number of objects with exactly one crossing found.
        missed: Number of objects without a crossing found.
        extra: Number of crossings of no object, or of one that was already counted.
        in_pairs: Number of objects that touch another one.
        pairs_once: Number of these with exactly one crossing found.
        error_ms: Median difference between found and true time.
    """

    objects: int
    once: int
    missed: int
    extra: int
    in_pairs: int
    pairs_once: int
    error_ms: float


def shots_of(belt: Belt) -> Shots:
    """Return the sequence of a belt; objects at the border of the picture are ignored."""

    def shots() -> Iterator[Shot]:
        for index in range(belt.frames):
            time_s = belt.time_s(index)
            truth = belt.boxes(time_s)
            ignored = border_boxes(belt, time_s, truth)
            yield Shot(index, belt.picture(index), belt.stamp_ns(index), dict(truth), ignored)

    return shots


def border_boxes(belt: Belt, time_s: float, whole: Mapping[int, Box]) -> list[Box]:
    """Return the boxes of the objects that are partly in the picture, cut at its border."""
    boxes = []
    for one in belt.positions(time_s):
        if one.id not in whole and -0.3 < one.x_mm / belt.length_mm < 1.3:
            outline = belt.outline(one.id, time_s)
            low = np.clip(outline.min(axis=0), 0, [belt.width, belt.height])
            high = np.clip(outline.max(axis=0), 0, [belt.width, belt.height])
            if (high > low).all():
                boxes.append((low[0], low[1], high[0] - low[0], high[1] - low[1]))
    return boxes


def crossings_of(
    belt: Belt, centres: Mapping[int, Sequence[tuple[float, float, float]]]
) -> list[Crossing]:
    """Return the crossings of the line by tracks in the direction of the belt.

    Args:
        belt: The belt; its plane and lens map pixels to millimetres.
        centres: Time in s, x and y in pixels of each track in the frames in which it is confirmed.
    """
    found = []
    for path in centres.values():
        rows = np.array(path)
        mm = belt.to_mm(rows[:, 1:])
        for index in range(1, len(rows)):
            before, after = mm[index - 1, 0], mm[index, 0]
            if before < LINE_MM <= after:
                share = (LINE_MM - before) / (after - before)
                time_s = rows[index - 1, 0] + share * (rows[index, 0] - rows[index - 1, 0])
                y_mm = mm[index - 1, 1] + share * (mm[index, 1] - mm[index - 1, 1])
                found.append(Crossing(float(time_s), float(y_mm)))
    return found


def counts(belt: Belt, found: Sequence[Crossing]) -> Counts:
    """Assign crossings to objects, by the least distance in time and Y, and count them.

    A crossing may belong to an object if it is at most ``LATEST_S`` and ``FARTHEST_MM`` off. Of two
    such crossings, one is assigned and the other is extra.
    """
    truth = [Crossing(belt.crossing_s(one.id, LINE_MM), one.y_mm) for one in belt.objects]
    apart_s = np.array([[abs(a.time_s - b.time_s) for b in found] for a in truth])
    apart_mm = np.array([[abs(a.y_mm - b.y_mm) for b in found] for a in truth])
    apart_s, apart_mm = apart_s.reshape(len(truth), -1), apart_mm.reshape(len(truth), -1)
    possible = (apart_s <= LATEST_S) & (apart_mm <= FARTHEST_MM)
    cost = np.where(possible, apart_s / LATEST_S + apart_mm / FARTHEST_MM, 100.0)
    rows, columns = linear_sum_assignment(cost)
    pairs = [
        (row, column) for row, column in zip(rows, columns, strict=True) if possible[row, column]
    ]
    assigned = {column for _, column in pairs}
    extra_at = {
        int(np.argmin(cost[:, column]))
        for column in range(len(found))
        if column not in assigned and possible[:, column].any()
    }
    once = {row for row, _ in pairs} - extra_at
    touching = {index for index, one in enumerate(belt.objects) if one.touches is not None}
    errors = [apart_s[row, column] * 1e3 for row, column in pairs]
    return Counts(
        objects=len(truth),
        once=len(once),
        missed=len(truth) - len(pairs),
        extra=len(found) - len(pairs),
        in_pairs=len(touching),
        pairs_once=len(once & touching),
        error_ms=float(np.median(errors)) if errors else float("nan"),
    )
