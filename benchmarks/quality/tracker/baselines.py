"""The baselines: SORT and ByteTrack on boxes, written from their papers; the tutorial's chain."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

from benchmarks.quality.tracker.scoring import overlaps
from benchmarks.quality.tracker.sequence import Box
from zv.tracker.pipelines.largest import LargestObject, LargestObjectParameters

Vector = NDArray[np.float64]


@dataclass(frozen=True)
class Detection:
    """A box that a detector found.

    Attributes:
        box: x, y, width, height in pixels.
        score: How sure it is, 0 to 1. Of a background subtraction: the share of the box that is
            foreground.
    """

    box: Box
    score: float


class Tutorial:
    """The tutorial's chain with its parameters: no tracks, one box a frame."""

    def __init__(self) -> None:
        self._chain = LargestObject(LargestObjectParameters(700, 25.0, True, 20, 5, 127))

    def update(self, bgr: NDArray[np.uint8]) -> Box | None:
        """Return the box of the largest moving object."""
        found, _ = self._chain.update(bgr)
        return None if found is None else found.box


class _Filter:
    """A Kalman filter of four measured values and the speeds of some, in frames."""

    def __init__(self, first: Vector, speeds: int, start: Vector) -> None:
        self.state = np.concatenate([first, np.zeros(speeds)])
        self.spread = np.diag(start)
        self._motion = np.eye(4 + speeds)
        self._motion[:speeds, 4:] += np.eye(speeds)

    def predict(self, process: Vector) -> None:
        self.state = self._motion @ self.state
        self.spread = self._motion @ self.spread @ self._motion.T + np.diag(process)

    def correct(self, measured: Vector, noise: Vector) -> None:
        seen = self.spread[:4, :4] + np.diag(noise)
        gain = np.linalg.solve(seen, self.spread[:4]).T
        self.state = self.state + gain @ (measured - self.state[:4])
        self.spread = self.spread - gain @ self.spread[:4]


def assigned(gain: NDArray[np.float64], least: float) -> list[tuple[int, int]]:
    """Return the pairs of row and column with the largest sum of gains, each at least ``least``."""
    if not gain.size:
        return []
    rows, columns = linear_sum_assignment(-gain)
    pairs = zip(rows.tolist(), columns.tolist(), strict=True)
    return [(row, column) for row, column in pairs if gain[row, column] >= least]


class Sort:
    """SORT: Kalman filter of centre, area and ratio; assignment by overlap.

    Source: A. Bewley et al., "Simple online and realtime tracking", 2016, with its parameters: an
    overlap of at least 0.3, output after 3 hits in a row, deletion after 1 frame without.
    """

    least_overlap = 0.3
    hits_to_show = 3
    frames_to_live = 1

    def __init__(self) -> None:
        self._tracks: list[_SortTrack] = []
        self._frames = 0
        self._next_id = 1

    def update(self, detections: Sequence[Detection]) -> dict[int, Box]:
        """Return the boxes by id in a frame with these detections."""
        self._frames += 1
        for track in self._tracks:
            track.predict()
        gain = overlaps([track.box for track in self._tracks], [one.box for one in detections])
        pairs = assigned(gain, self.least_overlap)
        for row, column in pairs:
            self._tracks[row].correct(detections[column].box)
        taken = {column for _, column in pairs}
        for index, detection in enumerate(detections):
            if index not in taken:
                self._tracks.append(_SortTrack(self._next_id, detection.box))
                self._next_id += 1
        self._tracks = [one for one in self._tracks if one.missing <= self.frames_to_live]
        young = self._frames <= self.hits_to_show
        return {
            track.id: track.box
            for track in self._tracks
            if not track.missing and (young or track.hits_in_row >= self.hits_to_show)
        }


class _SortTrack:
    """The state is the centre, the area, the ratio of the sides, and the speeds of the first 3."""

    NOISE = np.array([1.0, 1.0, 10.0, 10.0])
    PROCESS = np.array([1.0, 1.0, 1.0, 1.0, 0.01, 0.01, 1e-4])
    START = np.array([10.0, 10.0, 10.0, 10.0, 1e4, 1e4, 1e4])

    def __init__(self, identity: int, box: Box) -> None:
        self.id = identity
        self.missing = 0
        self.hits_in_row = 0
        self._filter = _Filter(self._measured(box), 3, self.START)

    @staticmethod
    def _measured(box: Box) -> Vector:
        x, y, width, height = box
        return np.array([x + width / 2, y + height / 2, width * height, width / height])

    def predict(self) -> None:
        if self._filter.state[2] + self._filter.state[6] <= 0:
            self._filter.state[6] = 0.0  # an area cannot become negative
        self._filter.predict(self.PROCESS)
        if self.missing:
            self.hits_in_row = 0
        self.missing += 1

    def correct(self, box: Box) -> None:
        self.missing = 0
        self.hits_in_row += 1
        self._filter.correct(self._measured(box), self.NOISE)

    @property
    def box(self) -> Box:
        x, y, area, ratio = self._filter.state[:4].tolist()
        width = float(np.sqrt(max(area, 1.0) * max(ratio, 1e-3)))
        height = max(area, 1.0) / width
        return (x - width / 2, y - height / 2, width, height)


class ByteTrack:
    """ByteTrack: sure boxes are assigned first, the others to the tracks that are left.

    Source: Y. Zhang et al., "ByteTrack: multi-object tracking by associating every detection box",
    2022, with its parameters, but for the thresholds of the score, which depend on the detector:
    here the score is the share of a box that is foreground, about 0.6 for a person.
    """

    sure = 0.35
    least_score = 0.1
    first_overlap = 0.2
    second_overlap = 0.5
    new_overlap = 0.3
    frames_to_live = 30

    def __init__(self) -> None:
        self._tracks: list[_ByteTrack] = []
        self._frames = 0
        self._next_id = 1

    def update(self, detections: Sequence[Detection]) -> dict[int, Box]:
        """Return the boxes by id in a frame with these detections."""
        self._frames += 1
        for track in self._tracks:
            track.predict()
        sure = [one for one in detections if one.score >= self.sure]
        unsure = [one for one in detections if self.least_score <= one.score < self.sure]
        known = [track for track in self._tracks if track.activated]
        new = [track for track in self._tracks if not track.activated]

        known, sure = self._assign(known, sure, self.first_overlap)
        tracked = [track for track in known if track.missing == 1]
        self._assign(tracked, unsure, self.second_overlap)
        new, sure = self._assign(new, sure, self.new_overlap)
        self._tracks = [track for track in self._tracks if track not in new and self._lives(track)]
        for detection in sure:
            # As published, tracks of the very first frame count at once, others when seen twice.
            self._tracks.append(_ByteTrack(self._next_id, detection.box, self._frames == 1))
            self._next_id += 1
        return {one.id: one.box for one in self._tracks if one.activated and not one.missing}

    def _lives(self, track: _ByteTrack) -> bool:
        return track.missing <= self.frames_to_live

    @staticmethod
    def _assign(
        tracks: list[_ByteTrack], detections: list[Detection], least: float
    ) -> tuple[list[_ByteTrack], list[Detection]]:
        """Correct tracks by what fits them; return the tracks and detections that are left."""
        gain = overlaps([one.box for one in tracks], [one.box for one in detections])
        pairs = assigned(gain, least)
        for row, column in pairs:
            tracks[row].correct(detections[column].box)
        rows, columns = {row for row, _ in pairs}, {column for _, column in pairs}
        return (
            [track for index, track in enumerate(tracks) if index not in rows],
            [one for index, one in enumerate(detections) if index not in columns],
        )


class _ByteTrack:
    """The state is the centre, the ratio of the sides, the height, and the speeds of all four."""

    POSITION, SPEED = 1 / 20, 1 / 160  # standard deviations, of the height

    def __init__(self, identity: int, box: Box, activated: bool) -> None:
        self.id = identity
        self.activated = activated
        self.missing = 0
        measured = self._measured(box)
        start = self._deviations(measured[3]) * np.array([2, 2, 1, 2, 10, 10, 1, 10])
        self._filter = _Filter(measured, 4, start**2)

    @staticmethod
    def _measured(box: Box) -> Vector:
        x, y, width, height = box
        return np.array([x + width / 2, y + height / 2, width / height, height])

    def _deviations(self, height: float) -> Vector:
        side, speed = self.POSITION * height, self.SPEED * height
        return np.array([side, side, 1e-2, side, speed, speed, 1e-5, speed])

    def predict(self) -> None:
        if self.missing:
            self._filter.state[7] = 0.0
        self._filter.predict(self._deviations(self._filter.state[3]) ** 2)
        self.missing += 1

    def correct(self, box: Box) -> None:
        self.missing = 0
        self.activated = True
        noise = self._deviations(self._filter.state[3])[:4]
        noise[2] = 1e-1
        self._filter.correct(self._measured(box), noise**2)

    @property
    def box(self) -> Box:
        x, y, ratio, height = self._filter.state[:4].tolist()
        width = max(ratio * height, 1.0)
        return (x - width / 2, y - height / 2, width, max(height, 1.0))
