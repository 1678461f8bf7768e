"""Scores boxes with ids against truth: CLEAR MOT and identity measures by motmetrics, and fit.

Sources: K. Bernardin, R. Stiefelhagen, "Evaluating multiple object tracking performance: the CLEAR
MOT metrics", 2008 (MOTA, switches); E. Ristani et al., "Performance measures and a data set for
multi-target, multi-camera tracking", 2016 (IDF1).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.quality.tracker.sequence import Box

MATCH_IOU = 0.5
MOSTLY = 0.5
"""Share of a box in an ignored one from which on the box is not false."""

METRICS = ("mota", "idf1", "num_switches", "num_misses", "num_false_positives", "num_objects")


def overlaps(one: Sequence[Box], other: Sequence[Box]) -> NDArray[np.float64]:
    """Return the intersection over union of each box of one list with each of another, (n, m)."""
    if not one or not other:
        return np.zeros((len(one), len(other)))
    a, b = np.array(one, float)[:, None], np.array(other, float)[None]
    low = np.maximum(a[..., :2], b[..., :2])
    high = np.minimum(a[..., :2] + a[..., 2:], b[..., :2] + b[..., 2:])
    common = np.clip(high - low, 0, None).prod(axis=2)
    union = a[..., 2:].prod(axis=2) + b[..., 2:].prod(axis=2) - common
    return np.asarray(common / np.maximum(union, 1e-9))


def without_ignored(
    found: Mapping[int, Box], truth: Sequence[Box], ignored: Sequence[Box]
) -> dict[int, Box]:
    """Return the found boxes except those that lie mostly in an ignored one and fit no true one."""
    kept = {}
    for identity, box in found.items():
        fits = overlaps([box], truth).max(initial=0.0) >= MATCH_IOU
        if fits or _covered(box, ignored) < MOSTLY:
            kept[identity] = box
    return kept


def _covered(box: Box, others: Sequence[Box]) -> float:
    """Return the largest share of a box that lies in one of the others."""
    x, y, width, height = box
    shares = [
        max(0.0, min(x + width, a + c) - max(x, a)) * max(0.0, min(y + height, b + d) - max(y, b))
        for a, b, c, d in others
    ]
    return max(shares, default=0.0) / max(width * height, 1e-9)


@dataclass
class Score:
    """Scores of one part of a sequence; figures in percent, counts as they are."""

    mota: float
    idf1: float
    switches: int
    misses: int
    false_boxes: int
    boxes: int
    """Number of boxes in the truth."""
    fit: float
    """Share of the frames with objects in which the centroid's box has an IoU of 0.5 with one."""
    frames: int

    @property
    def recall(self) -> float:
        """Share of the true boxes that were found."""
        return 100 * (1 - self.misses / max(1, self.boxes))

    @property
    def precision(self) -> float:
        """Share of the found boxes that are true."""
        right = self.boxes - self.misses
        return 100 * right / max(1, right + self.false_boxes)


@dataclass
class Scorer:
    """Compares what one method finds in one sequence, frame by frame."""

    history: list[tuple[int, dict[int, Box], dict[int, Box]]] = field(default_factory=list)
    """Index of the picture, truth, and what was found, without ignored boxes."""
    fits: dict[int, bool] = field(default_factory=dict)

    def add(
        self,
        index: int,
        truth: Mapping[int, Box],
        ignored: Sequence[Box],
        found: Mapping[int, Box],
        centroid: Box | None,
    ) -> None:
        """Add the result of a frame."""
        boxes = list(truth.values())
        self.history.append((index, dict(truth), without_ignored(found, boxes, ignored)))
        if boxes:
            fitting = [] if centroid is None else overlaps([centroid], boxes)
            self.fits[index] = bool(np.max(fitting, initial=0.0) >= MATCH_IOU)

    def score(self, first: int = 0, end: int | None = None) -> Score:
        """Return the scores of the pictures with first <= index < end, as motmetrics has them."""
        values = self._computed(self._events(first, end))
        fits = [fit for index, fit in self.fits.items() if first <= index < (end or index + 1)]
        return Score(
            mota=100 * float(values["mota"]),
            idf1=100 * float(values["idf1"]),
            switches=int(values["num_switches"]),
            misses=int(values["num_misses"]),
            false_boxes=int(values["num_false_positives"]),
            boxes=int(values["num_objects"]),
            fit=100 * float(np.mean(fits)) if fits else float("nan"),
            frames=len(fits),
        )

    def at_each(self, step: int) -> Scorer:
        """Return the results of the pictures whose index is a multiple of ``step`` alone."""
        history = [each for each in self.history if each[0] % step == 0]
        fits = {index: fit for index, fit in self.fits.items() if index % step == 0}
        return Scorer(history, fits)

    def errors(self) -> list[tuple[int, str, int | None, int | None]]:
        """Return the errors: picture, SWITCH or MISS or FP, id in the truth, id found."""
        events = self._events(0, None).events
        rows = []
        for (index, _), row in events.iterrows():
            if row["Type"] in ("SWITCH", "MISS", "FP"):
                ids = [None if np.isnan(row[name]) else int(row[name]) for name in ("OId", "HId")]
                rows.append((int(index), str(row["Type"]), ids[0], ids[1]))
        return rows

    def _events(self, first: int, end: int | None) -> Any:
        import motmetrics  # of the dependency group quality

        events = motmetrics.MOTAccumulator(auto_id=False)
        for index, truth, found in self.history:
            if first <= index < (end or index + 1):
                shared = overlaps(list(truth.values()), list(found.values()))
                distances = np.where(shared >= MATCH_IOU, 1 - shared, np.nan)
                events.update(list(truth), list(found), distances, frameid=index)
        return events

    @staticmethod
    def _computed(events: Any) -> Any:
        import motmetrics

        table = motmetrics.metrics.create().compute(events, metrics=list(METRICS), name="all")
        return table.loc["all"]


def check_the_scores() -> None:
    """Score a case that was worked out by hand, since no test of the project has motmetrics.

    Two objects stand for four pictures. Object 1 is found as 10, from the third picture on as 12: a
    switch. Object 2 is missed in the first picture, then found as 20. Picture 4 has a false box. So
    of 8 boxes 1 is missed, 1 is false, 1 switches: MOTA is 1 - 3/8. The best assignment of ids
    gives object 1 two of its four boxes (10 or 12) and object 2 its three: 5 right of 8 in the
    truth and 8 found, so that IDF1 is 2 * 5 / (8 + 8).

    Raises:
        AssertionError: If the scores are others.
    """
    one, two, nowhere = (0.0, 0.0, 10.0, 20.0), (50.0, 0.0, 10.0, 20.0), (0.0, 90.0, 5.0, 5.0)
    scorer = Scorer()
    for index, found in enumerate(
        [{10: one}, {10: one, 20: two}, {12: one, 20: two}, {12: one, 20: two, 30: nowhere}]
    ):
        scorer.add(index, {1: one, 2: two}, [], found, one)
    score = scorer.score()
    assert (score.misses, score.false_boxes, score.switches, score.boxes) == (1, 1, 1, 8)
    assert (round(score.mota, 6), round(score.idf1, 6), score.fit) == (62.5, 62.5, 100)
