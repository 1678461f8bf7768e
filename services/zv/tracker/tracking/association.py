"""Decides which regions of a frame belong to which tracks: a pure function of both."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from zv.tracker.tracking import boxes
from zv.tracker.tracking.pieces import PieceLimits, around_largest, joined
from zv.tracker.tracking.region import Region, union
from zv.tracker.tracking.state import TrackState


@dataclass(frozen=True, slots=True)
class AssociationLimits:
    """The constants of association."""

    # A region may belong to a track if its intersection with the track's expected box exceeds this
    # share of the smaller of the two.
    overlap: float = 0.4
    # Half of the distance, in sides, at which a region may still be the track's, without the
    # uncertainty of its place.
    gate_sides: float = 0.7
    log_area: float = 1.2  # largest ratio of their areas, as a natural logarithm
    # After being seen alone for this long, a track is an object of its own, not a part of another.
    proven_s: float = 0.4
    # Sharing a region for a second takes so many seconds of that away again: what was seen alone
    # for a moment and never again was a part.
    doubt: float = 0.2
    # A track that is not confirmed yet is a part of another one if its area is smaller than this
    # share of the other's.
    part: float = 0.3
    pieces: PieceLimits = field(default_factory=PieceLimits)  # the constants of joining pieces


@dataclass(frozen=True, slots=True)
class Follow:
    """The track is seen as this region, which shows no other one."""

    track: TrackState
    region: Region


@dataclass(frozen=True, slots=True)
class Share:
    """The tracks share these regions; their pixels are to be divided among them."""

    tracks: tuple[TrackState, ...]
    regions: tuple[Region, ...]


@dataclass(frozen=True, slots=True)
class End:
    """The track is a part of another one."""

    track: TrackState


@dataclass(frozen=True, slots=True)
class Begin:
    """The region is a new object."""

    region: Region


Decision = Follow | Share | End | Begin


def associate(
    tracks: Sequence[TrackState],
    regions: Sequence[Region],
    limits: AssociationLimits,
    *,
    convex: bool = False,
) -> list[Decision]:
    """Return what each region of a frame is. Nothing is changed."""
    if not convex:
        known = [each.box for each in tracks if _established(each, 0.0, limits)]
        regions = joined(regions, known, limits.pieces)
    links = _links(tracks, regions, limits)
    decisions: list[Decision] = []
    for rows, columns in boxes.components(links):
        owned = [regions[column] for column in columns]
        members = [tracks[row] for row in rows]
        if len(members) == 1:
            found = owned[0] if convex else around_largest(owned)
            decisions.append(Follow(members[0], found))
        else:
            decisions += _together(members, owned, limits)
    used = {part for each in decisions for part in _parts_used(each)}
    return [*decisions, *(Begin(each) for each in regions if each not in used)]


def _links(
    tracks: Sequence[TrackState], regions: Sequence[Region], limits: AssociationLimits
) -> NDArray[np.bool_]:
    """Return which regions may belong to which tracks: (tracks, regions)."""
    links = boxes.overlaps([track.box for track in tracks], regions) > limits.overlap
    rows = np.flatnonzero(~links.any(axis=1))
    columns = np.flatnonzero(~links.any(axis=0))
    if not rows.size or not columns.size:
        return links
    rest = [regions[column] for column in columns.tolist()]
    costs = [
        track.costs(rest, (track.x.position, track.y.position), limits.gate_sides, limits.log_area)
        for track in (tracks[row] for row in rows.tolist())
    ]
    for number, found in boxes.assigned(np.array(costs)):
        links[rows[number], columns[found]] = True
    return links


def _together(
    members: list[TrackState], owned: list[Region], limits: AssociationLimits
) -> list[Decision]:
    """Return what the regions of several tracks are."""
    pairs = _one_for_each(members, owned)
    if pairs is not None:
        return [Follow(members[row], owned[column]) for row, column in pairs]
    whole = union(owned)
    largest = max(each.area for each in members)
    established = [each for each in members if _established(each, largest, limits)]
    if len(established) > 1:
        parts = [each for each in members if each not in established]
        rest: Decision = Share(tuple(established), tuple(owned))
    else:
        most = max(established or members, key=lambda each: (each.confirmed, each.area, -each.id))
        parts = [each for each in members if each is not most]
        rest = Follow(most, whole)
    return [*map(End, parts), rest]


def _established(track: TrackState, largest: float, limits: AssociationLimits) -> bool:
    """Return whether a track is an object of its own, not a part of one of the largest area."""
    return track.alone_s >= limits.proven_s and (
        track.confirmed or track.area >= limits.part * largest
    )


def _parts_used(decision: Decision) -> Sequence[Region]:
    match decision:
        case Follow(_, region):
            return [*region.parts, region]
        case Share(_, regions):
            return regions
        case _:
            return []


def _one_for_each(members: list[TrackState], owned: list[Region]) -> list[tuple[int, int]] | None:
    """Return pairs of tracks and regions, one for each track; None if that is not possible."""
    if len(owned) < len(members):
        return None
    costs = np.full((len(members), len(owned)), boxes.IMPOSSIBLE)
    for row, track in enumerate(members):
        for column, region in enumerate(owned):
            if not (
                region.height > 0.6 * track.height
                and 0.4 * track.area < region.area < 1.7 * track.area
                and region.width < 1.6 * track.width
            ):
                continue
            away = math.dist(region.center, track.box.center) / track.side
            if away < 1.5:
                costs[row, column] = away
    pairs = boxes.assigned(costs)
    return pairs if len(pairs) == len(members) else None
