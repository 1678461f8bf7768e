"""Counts what crosses the middle of a real clip, at several rates and with lost frames."""

from __future__ import annotations

from collections import Counter
from itertools import pairwise

import numpy as np

from benchmarks.quality.tracker.clips import Clip
from benchmarks.quality.tracker.sequence import START_NS
from zv.tracker.events.track_events import EventRules, TrackEvents
from zv.tracker.pipelines.robust import RobustTracker
from zv.tracker.shapes import Line, turn

LOST = 0.4
RUNS = 20
STEPS = (1, 2, 3)
"""Each picture, each second one, each third one."""


def line_in(clip: Clip) -> Line:
    """Return the vertical line in the middle of a clip's pictures."""
    width, height = clip.size
    return Line("middle", (width / 2, 0.0), (width / 2, float(height)))


def true_counts(clip: Clip) -> Counter[str]:
    """Return how many objects of the truth cross the line, by direction."""
    line, sides = line_in(clip), dict[int, list[bool]]()
    for index in sorted(clip.truth):
        for identity, (x, y, width, height) in clip.truth[index].items():
            place = (x + width / 2, y + height / 2)
            sides.setdefault(identity, []).append(turn(line.start, line.end, place) >= 0)
    return Counter(
        "right" if after else "left"
        for each in sides.values()
        for before, after in pairwise(each)
        if before != after
    )


def counted(clip: Clip, step: int, lost: float, seed: int) -> Counter[str]:
    """Return the crossings that the tracker's events count, by direction.

    Args:
        clip: A clip.
        step: Each of so many pictures is used, from one of the first on.
        lost: Share of these that is lost.
        seed: Of what is lost, and of the first picture.
    """
    random = np.random.default_rng(seed)
    robust, events = RobustTracker(), TrackEvents(EventRules((), (line_in(clip),), 10.0, "centre"))
    found: Counter[str] = Counter()
    for index in range(seed % step, len(clip.pictures), step):
        if random.random() < lost:
            continue
        stamp_ns = START_NS + round(index * 1e9 / clip.rate_hz)
        robust.update(np.ascontiguousarray(clip.pictures[index]), stamp_ns, clip.size)
        happened = events.update(robust.still, stamp_ns)  # as the service does
        found.update(each.direction for each in happened if each.direction is not None)
    found.update(each.direction for each in events.end() if each.direction is not None)
    return found
