"""Decides which boxes of a model belong to which tracks: a pure function of both.

Unlike a region of the foreground, each box is one object, and says how sure the model is.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from zv.tracker.tracking import boxes
from zv.tracker.tracking.region import Region
from zv.tracker.tracking.state import BoxState


class ScoredBox(NamedTuple):
    """A box of a model, in pixels of the picture."""

    region: Region
    score: float  # how sure the model is, 0 to 1
    name: str  # name of its class
    least: float  # the score from which on it begins a track


@dataclass(frozen=True, slots=True)
class BoxLimits:
    """The constants of the association of boxes."""

    overlap: float = 0.3  # least intersection over union of a box and the box that is expected
    unsure_overlap: float = 0.4  # the same for boxes that are not sure enough to begin a track
    # Half of the distance, in sides, at which a box may still be the track's, without the
    # uncertainty of its place.
    gate_sides: float = 0.5
    log_area: float = 0.7  # largest ratio of their areas, as a natural logarithm
    other_class: float = 0.3  # added to the cost of a box of another class
    same: float = 0.7  # a box that overlaps a track's new box by more than this is the same object


def match_boxes(
    tracks: Sequence[BoxState],
    expected: Sequence[Region],
    found: Sequence[ScoredBox],
    limits: BoxLimits,
) -> tuple[list[tuple[int, int]], list[int]]:
    """Return which box belongs to which track, by indices, and which boxes are new objects.

    Boxes that are sure are assigned first, those that are not to the tracks that are left: an
    object that is partly hidden has a low score. Source: Y. Zhang et al., "ByteTrack: multi-object
    tracking by associating every detection box", 2022. What moved farther than its own size is
    then found by its distance.
    """
    sure = [number for number, each in enumerate(found) if each.score >= each.least]
    unsure = [number for number, each in enumerate(found) if each.score < each.least]
    shared = boxes.unions(expected, [each.region for each in found])
    other = [[track.class_name != each.name for each in found] for track in tracks]
    costs = 1 - shared + limits.other_class * np.array(other, np.float64).reshape(shared.shape)
    pairs: list[tuple[int, int]] = []

    def assign(rows: list[int], columns: list[int], allowed: NDArray[np.bool_]) -> None:
        mine = {row for row, _ in pairs}
        taken = {column for _, column in pairs}
        rows = [row for row in rows if row not in mine]
        columns = [column for column in columns if column not in taken]
        if rows and columns:
            part = np.ix_(rows, columns)
            cost = np.where(allowed[part], costs[part], boxes.IMPOSSIBLE)
            pairs.extend((rows[row], columns[column]) for row, column in boxes.assigned(cost))

    everything = list(range(len(tracks)))
    confirmed = [row for row in everything if tracks[row].confirmed]
    near = shared >= limits.overlap
    assign(confirmed, sure, near)
    assign(confirmed, unsure, shared >= limits.unsure_overlap)
    assign(everything, sure, near)
    if len(pairs) < min(len(tracks), len(sure)):
        regions, centers = [each.region for each in found], [box.center for box in expected]
        away = [
            track.costs(regions, center, limits.gate_sides, limits.log_area)
            for track, center in zip(tracks, centers, strict=True)
        ]
        costs = np.where(other, boxes.IMPOSSIBLE, away)
        assign(everything, sure, costs < boxes.IMPOSSIBLE)
    taken = {column for _, column in pairs}
    known = [found[column].region for column in taken]
    new = []
    for column in sure:
        if column in taken:
            continue
        region = found[column].region
        if not known or boxes.unions([region], known).max() < limits.same:
            new.append(column)
            known.append(region)
    return pairs, new
