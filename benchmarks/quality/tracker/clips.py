"""Scores trackers on the real clips with ground truth.

The clips are read from the folder ``clips`` of the data; its README says how their truth is meant.
Pictures are reduced as ``zv tracker`` reduces them, once, and kept in a temporary folder.
"""

from __future__ import annotations

import json
import os
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Protocol

import cv2
import numpy as np
from numpy.typing import NDArray

from benchmarks.quality.data import data_folder
from benchmarks.quality.tracker.baselines import ByteTrack, Detection, Sort
from benchmarks.quality.tracker.scoring import Score, Scorer
from benchmarks.quality.tracker.sequence import START_NS, Box, read_mot
from zv.tracker.pipelines.base import working_scale
from zv.tracker.pipelines.robust import RobustParameters, RobustTracker

Pixels = NDArray[np.uint8]

LEAST_SHARE = 0.0008
"""Least area of a baseline's box, as a share of the picture."""

STANDS_LATER = ("office",)


@dataclass(frozen=True)
class Clip:
    """One clip with its truth.

    Attributes:
        name: Name of its folder.
        pictures: (n, height, width, 3) uint8, reduced, mapped from a file.
        size: Width and height of the clip.
        rate_hz: Its frame rate.
        first: Index of the first picture that is scored.
        truth: The boxes to be found, by index of the picture and id.
        ignored: The boxes that may be found or not, in the same way.
    """

    name: str
    pictures: Pixels
    size: tuple[int, int]
    rate_hz: float
    first: int
    truth: Mapping[int, Mapping[int, Box]]
    ignored: Mapping[int, Mapping[int, Box]]


class Method(Protocol):
    """Something that finds boxes with ids."""

    def update(self, picture: Pixels, stamp_ns: int, size: tuple[int, int], /) -> dict[int, Box]:
        """Return the boxes of a picture, which shows a frame of this size."""
        ...


class Robust:
    """The product with some parameters."""

    def __init__(self, parameters: RobustParameters | None = None) -> None:
        self._robust = RobustTracker(parameters)

    def update(self, picture: Pixels, stamp_ns: int, size: tuple[int, int]) -> dict[int, Box]:
        """Return the boxes of the confirmed tracks."""
        tracks = self._robust.update(picture, stamp_ns, size)
        return {each.id: each.box for each in tracks if each.state == "confirmed"}


class Plain:
    """OpenCV's background subtractor, a median, components, and a tracker on their boxes."""

    def __init__(self, subtractor: Any, tracker: Sort | ByteTrack) -> None:
        self._subtractor = subtractor
        self._tracker = tracker

    def update(self, picture: Pixels, _: int, size: tuple[int, int], /) -> dict[int, Box]:
        """Return the boxes of the tracker."""
        mask = cv2.threshold(self._subtractor.apply(picture), 127, 255, cv2.THRESH_BINARY)[1]
        _, _, stats, _ = cv2.connectedComponentsWithStats(cv2.medianBlur(mask, 5))
        scale = size[0] / picture.shape[1]
        found = []
        for x, y, width, height, area in stats[1:].tolist():
            if area >= LEAST_SHARE * mask.size:
                box = (scale * x, scale * y, scale * width, scale * height)
                found.append(Detection(box, area / (width * height)))
        return self._tracker.update(found)


METHODS: dict[str, Callable[[], Method]] = {
    "robust": Robust,
    "KNN, SORT": lambda: Plain(cv2.createBackgroundSubtractorKNN(), Sort()),
    "KNN, ByteTrack": lambda: Plain(cv2.createBackgroundSubtractorKNN(), ByteTrack()),
    "MOG2, SORT": lambda: Plain(cv2.createBackgroundSubtractorMOG2(), Sort()),
    "MOG2, ByteTrack": lambda: Plain(cv2.createBackgroundSubtractorMOG2(), ByteTrack()),
}


def clips() -> Iterator[Clip]:
    """Yield the clips that are there."""
    folder = data_folder() / "clips"
    for path in sorted(folder.glob("*/clip.mp4")):
        info = json.loads((path.parent / "info.json").read_text())
        yield _clip(
            path.parent.name,
            path,
            path.parent / "gt.txt",
            float(info["fps"]),
            int(info["first_scored_frame"]) - 1,
            int(info["frames"]),
        )
    video, truth = data_folder() / "vtest.avi", data_folder() / "pets_s2l1_gt_first265.txt"
    if video.exists() and truth.exists():
        yield _clip("vtest", video, truth, 10.0, 0, 265)


def _clip(name: str, video: Path, truth: Path, rate_hz: float, first: int, count: int) -> Clip:
    pictures, size = _pictures(name, video, count)
    return Clip(
        name, pictures, size, rate_hz, first, read_mot(truth), read_mot(truth, ignored=True)
    )


def _pictures(name: str, video: Path, count: int) -> tuple[Pixels, tuple[int, int]]:
    opened = cv2.VideoCapture(str(video))
    size = int(opened.get(cv2.CAP_PROP_FRAME_WIDTH)), int(opened.get(cv2.CAP_PROP_FRAME_HEIGHT))
    scale = working_scale(*size)
    small = -(-size[0] // scale), -(-size[1] // scale)
    folder = Path(tempfile.gettempdir()) / "zv-quality-clips"
    folder.mkdir(exist_ok=True)
    path = folder / f"{name}-{small[0]}x{small[1]}-{count}.npy"
    if not path.exists():
        pictures = []
        for _ in range(count):
            read, bgr = opened.read()
            if not read:
                break
            pictures.append(cv2.resize(bgr, small, interpolation=cv2.INTER_AREA))
        # Another process may read the clip at this moment.
        with tempfile.NamedTemporaryFile(dir=folder, suffix=".part", delete=False) as whole:
            np.save(whole, np.array(pictures, np.uint8))
        os.replace(whole.name, path)
    opened.release()
    return np.load(path, mmap_mode="r"), size


def seen_otherwise(clip: Clip) -> Iterator[Clip]:
    """Yield a clip at 10 Hz or a little more; and so, mirrored and begun after a fifth of it.

    Rules and constants that owe their score to luck lose it there. A clip in which most of the
    truth stands still at the later beginning, so that nothing can know of it, is not begun later.
    """
    step = max(1, round(clip.rate_hz / 10))
    yield _cut(clip, clip.name, 0, step, mirrored=False)
    later = clip.first + (len(clip.pictures) - clip.first) // 5
    start = 0 if clip.name in STANDS_LATER else later
    yield _cut(clip, f"{clip.name}, mirrored", start, step, mirrored=True)


def _cut(clip: Clip, name: str, start: int, step: int, *, mirrored: bool) -> Clip:
    def cut(boxes: Mapping[int, Mapping[int, Box]]) -> dict[int, dict[int, Box]]:
        return {
            (index - start) // step: {
                identity: (clip.size[0] - x - width if mirrored else x, y, width, height)
                for identity, (x, y, width, height) in found.items()
            }
            for index, found in boxes.items()
            if index >= start and (index - start) % step == 0
        }

    settled = start + round(clip.rate_hz) if start else clip.first  # a second to see the scene
    return replace(
        clip,
        name=name,
        pictures=clip.pictures[start::step, :, :: -1 if mirrored else 1],
        rate_hz=clip.rate_hz / step,
        first=-(-(settled - start) // step),
        truth=cut(clip.truth),
        ignored=cut(clip.ignored),
    )


def measure(clip: Clip, method: Method, first: int | None = None) -> tuple[Score, float, float]:
    """Return the score of a method on a clip, its false boxes a frame, and its ms a frame."""
    scorer, spent_s, scored = Scorer(), 0.0, 0
    for index, kept in enumerate(clip.pictures):
        picture = np.ascontiguousarray(kept)
        stamp_ns = START_NS + round(index * 1e9 / clip.rate_hz)
        begun_s = time.thread_time()
        found = method.update(picture, stamp_ns, clip.size)
        spent_s += time.thread_time() - begun_s
        if index >= (clip.first if first is None else first):
            scored += 1
            ignored = list(clip.ignored.get(index, {}).values())
            scorer.add(index, clip.truth.get(index, {}), ignored, found, None)
    score = scorer.score()
    return score, score.false_boxes / max(1, scored), 1e3 * spent_s / len(clip.pictures)


def means(scores: Mapping[str, Score]) -> tuple[float, float]:
    """Return the mean MOTA and IDF1 over the clips that have objects."""
    rows = [(each.mota, each.idf1) for each in scores.values() if each.boxes]
    mota, idf1 = np.mean(rows, axis=0).tolist()
    return mota, idf1
