"""Runs the robust pipeline and the baselines through one sequence, and scores all of them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

from benchmarks.quality.tracker.baselines import ByteTrack, Detection, Sort, Tutorial
from benchmarks.quality.tracker.scoring import Scorer
from benchmarks.quality.tracker.sequence import Box, Shot, Shots
from zv.tracker.tracking.region import Region
from zv.tracker.tracking.track import Track

METHODS = ("tutorial", "SORT", "ByteTrack", "robust")


@dataclass
class Found:
    """The result of one method in one frame: boxes by id, and the centroid's box."""

    boxes: dict[int, Box]
    centroid: Box | None


@dataclass
class Result:
    """The results of all methods in one frame, and the tracks and detections of ``robust``."""

    found: dict[str, Found]
    tracks: list[Track]
    detections: list[Detection]


@dataclass
class Comparison:
    """Scores of each method in one sequence.

    SORT and ByteTrack get the boxes that the robust pipeline finds before it tracks, in the same
    run, so that only the tracking differs. The tutorial's pipeline has no ids, so it is scored by
    its fit alone.
    """

    scorers: dict[str, Scorer] = field(default_factory=lambda: {name: Scorer() for name in METHODS})
    results: dict[int, Result] = field(default_factory=dict)


def compare(
    shots: Shots,
    each: Callable[[Shot, Result], None] | None = None,
    tutorial: bool = True,
    convex: bool = False,
) -> Comparison:
    """Return the scores of all methods in a sequence.

    Args:
        shots: The sequence; it is iterated once.
        each: Called with each frame and its results.
        tutorial: Whether to run the tutorial's pipeline, the slowest.
        convex: Whether regions are cut where convex objects touch.
    """
    from zv.tracker.pipelines.base import working_scale
    from zv.tracker.pipelines.robust import RobustParameters, RobustTracker

    comparison = Comparison()
    robust = RobustTracker(RobustParameters(convex=convex))
    chain, sort, bytetrack = Tutorial(), Sort(), ByteTrack()
    for shot in shots():
        tracks = robust.update(shot.bgr, shot.stamp_ns)
        scale = working_scale(*shot.bgr.shape[1::-1])
        detections = [_detection(each.scaled(scale)) for each in robust.regions]
        confirmed = {track.id: _box(track) for track in tracks if track.state == "confirmed"}
        chosen = robust.centroid
        found = {
            "tutorial": Found({}, chain.update(shot.bgr) if tutorial else None),
            "SORT": _largest(sort.update(detections)),
            "ByteTrack": _largest(bytetrack.update(detections)),
            "robust": Found(confirmed, None if chosen is None else _box(chosen)),
        }
        result = Result(found, tracks, detections)
        comparison.results[shot.index] = result
        for name, one in found.items():
            comparison.scorers[name].add(
                shot.index, shot.truth, shot.ignored, one.boxes, one.centroid
            )
        if each is not None:
            each(shot, result)
    return comparison


def _box(track: Track) -> Box:
    x, y, width, height = track.box
    return (x, y, width, height)


def _largest(boxes: dict[int, Box]) -> Found:
    return Found(boxes, max(boxes.values(), key=lambda box: box[2] * box[3], default=None))


def _detection(region: Region) -> Detection:
    left, top = round(region.left), round(region.top)
    width, height = round(region.width), round(region.height)
    score = min(1.0, region.area / max(width * height, 1))
    return Detection((left, top, width, height), score)
