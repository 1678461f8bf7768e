"""Scores the association of a model's boxes beside SORT and ByteTrack, on the same boxes.

The boxes are those of the ground truth, of the clips and of two sequences of MOT15 whose labels
come with motmetrics, with noise, misses, false boxes and scores added; no picture is read.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from benchmarks.quality.data import data_folder
from benchmarks.quality.tracker.baselines import ByteTrack, Detection, Sort
from benchmarks.quality.tracker.scoring import Score, Scorer
from benchmarks.quality.tracker.sequence import Box, read_mot
from zv.tracker.tracking.box_association import ScoredBox
from zv.tracker.tracking.box_tracker import BoxTracker
from zv.tracker.tracking.region import Region

SEEDS = (1, 2, 3)
LEAST = 0.5
"""The score from which on a box begins a track, of all methods."""


@dataclass(frozen=True)
class Faults:
    """How a model's boxes differ from the truth.

    Attributes:
        jitter: Standard deviation of each edge, as a share of the box's width or height.
        missed: Share of the boxes that are not found.
        gap: Mean length of a run of misses, frames.
        false: False boxes a frame; half of them stay at their place for some frames.
        sure: Mean of the scores of true boxes; those of false ones are about half of it.
    """

    jitter: float = 0.04
    missed: float = 0.1
    gap: float = 2.0
    false: float = 0.3
    sure: float = 0.75


FAULTS = {
    "good model": Faults(0.02, 0.03, 1.0, 0.1, 0.85),
    "usual model": Faults(),
    "poor model": Faults(0.06, 0.25, 3.0, 1.0, 0.6),
}


@dataclass(frozen=True)
class Labels:
    """The truth of a sequence.

    Attributes:
        name: Its name.
        size: Width and height of its pictures.
        rate_hz: Its frame rate.
        truth: The boxes to be found, by index of the picture and id.
        ignored: The boxes that may be found or not.
        frames: Number of its pictures.
    """

    name: str
    size: tuple[int, int]
    rate_hz: float
    truth: Mapping[int, Mapping[int, Box]]
    ignored: Mapping[int, Mapping[int, Box]]
    frames: int


def labels() -> Iterator[Labels]:
    """Yield the sequences that are there."""
    for name, size in (("TUD-Campus", (640, 480)), ("TUD-Stadtmitte", (640, 480))):
        path = Path(str(files("motmetrics") / "data" / name / "gt.txt"))
        truth = read_mot(path)
        yield Labels(name, size, 25.0, truth, {}, max(truth) + 1)
    folder = data_folder() / "clips"
    for path in sorted(folder.glob("*/gt.txt")):
        info = json.loads((path.parent / "info.json").read_text())
        truth, ignored = read_mot(path), read_mot(path, ignored=True)
        if truth:
            size = (int(info["size"][0]), int(info["size"][1]))
            rate_hz, frames = float(info["fps"]), int(info["frames"])
            yield Labels(path.parent.name, size, rate_hz, truth, ignored, frames)
    path = data_folder() / "pets_s2l1_gt_first265.txt"
    if path.exists():
        truth = read_mot(path)
        yield Labels("vtest", (768, 576), 10.0, truth, {}, max(truth) + 1)


def found_by(labels: Labels, faults: Faults, seed: int) -> Iterator[list[Detection]]:
    """Yield the boxes that a model would find in each picture."""
    rng = np.random.default_rng(seed)
    missing: dict[int, int] = {}
    standing: list[tuple[Box, int]] = []
    width, height = labels.size
    for index in range(labels.frames):
        truth = {**labels.ignored.get(index, {}), **labels.truth.get(index, {})}
        found = []
        for identity, box in truth.items():
            left = missing.pop(identity, 0)
            if left:
                missing[identity] = left - 1
                if left > 1:
                    continue
            elif rng.random() < faults.missed / faults.gap:
                missing[identity] = 1 + int(rng.geometric(1 / faults.gap))
                continue
            hidden = max(
                (_covered(box, other) for key, other in truth.items() if key != identity), default=0
            )
            score = float(np.clip(rng.normal(faults.sure, 0.12) * (1 - 0.5 * hidden), 0.05, 0.99))
            found.append(Detection(_jittered(box, faults.jitter, rng), score))
        for _ in range(rng.poisson(faults.false)):
            side = rng.uniform(0.05, 0.25) * height
            box = (rng.uniform(0, width), rng.uniform(0, height), side / 2, side)
            standing.append((box, int(rng.integers(1, 4)) if rng.random() < 0.5 else 1))
        for box, _ in standing:
            score = float(np.clip(rng.normal(faults.sure / 2, 0.12), 0.05, 0.99))
            found.append(Detection(_jittered(box, faults.jitter, rng), score))
        standing = [(box, left - 1) for box, left in standing if left > 1]
        yield found


def _jittered(box: Box, share: float, rng: np.random.Generator) -> Box:
    x, y, width, height = box
    left, top, right, bottom = rng.normal(0, share, 4) * (width, height, width, height)
    return x + left, y + top, max(2.0, width + right - left), max(2.0, height + bottom - top)


def _covered(box: Box, other: Box) -> float:
    """Return the share of a box that another one, whose foot is lower, hides."""
    if other[1] + other[3] <= box[1] + box[3]:
        return 0.0
    across = min(box[0] + box[2], other[0] + other[2]) - max(box[0], other[0])
    down = min(box[1] + box[3], other[1] + other[3]) - max(box[1], other[1])
    return max(0.0, across) * max(0.0, down) / max(1e-9, box[2] * box[3])


class Method(Protocol):
    """Something that turns boxes into tracks."""

    def update(self, found: list[Detection], index: int, /) -> Mapping[int, Box]:
        """Return the boxes by id in a picture with these boxes."""
        ...


class Product:
    """The association of the pipeline ``detector``."""

    def __init__(self, labels: Labels, **constants: Any) -> None:
        self._tracker = BoxTracker(labels.size, **constants)
        self._rate_hz = labels.rate_hz

    def update(self, found: list[Detection], index: int) -> dict[int, Box]:
        """Return the boxes of the confirmed tracks."""
        self._tracker.predict(index / self._rate_hz)
        self._tracker.see([_scored(each) for each in found if each.score >= 0.1])
        return {each.id: each.box for each in self._tracker.finish() if each.state == "confirmed"}


class Baseline:
    """SORT or ByteTrack; SORT sees the sure boxes alone, as it has no use for others."""

    def __init__(self, tracker: Sort | ByteTrack, least: float) -> None:
        self._tracker = tracker
        self._least = least

    def update(self, found: list[Detection], _: int) -> dict[int, Box]:
        """Return the boxes of the tracker."""
        return self._tracker.update([each for each in found if each.score >= self._least])


class SureByteTrack(ByteTrack):
    """ByteTrack with the score of a model."""

    sure = LEAST


METHODS: dict[str, Callable[[Labels], Method]] = {
    "detector": Product,
    "SORT": lambda _: Baseline(Sort(), LEAST),
    "ByteTrack": lambda _: Baseline(SureByteTrack(), 0.1),
}


def _scored(found: Detection) -> ScoredBox:
    x, y, width, height = found.box
    return ScoredBox(Region(x, y, x + width, y + height, width * height), found.score, "", LEAST)


def measure(labels: Labels, faults: Faults, make: Callable[[Labels], Method]) -> Score:
    """Return the mean score of a method over the seeds."""
    scores = []
    for seed in SEEDS:
        scorer, method = Scorer(), make(labels)
        for index, found in enumerate(found_by(labels, faults, seed)):
            boxes = method.update(found, index)
            ignored = list(labels.ignored.get(index, {}).values())
            scorer.add(index, labels.truth.get(index, {}), ignored, boxes, None)
        scores.append(scorer.score())
    return Score(*(float(np.mean([getattr(each, name) for each in scores])) for name in FIELDS))


FIELDS = tuple(Score.__dataclass_fields__)
