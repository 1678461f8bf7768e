"""Tracks all moving objects of a fixed camera: background subtraction, then tracking."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import cv2
import numpy as np

from zv.tracker.foreground.concavities import cut_at_concavities
from zv.tracker.foreground.foreground import ForegroundParameters
from zv.tracker.foreground.ghosts import BAND, LEAST_EVIDENCE, evidence
from zv.tracker.foreground.regions import RegionLimits, regions_of
from zv.tracker.pipelines.base import LEAST_SHARE, Image, PipelineWithIds
from zv.tracker.tracking.appearance import Scene
from zv.tracker.tracking.region import Region
from zv.tracker.tracking.track import Track
from zv.tracker.tracking.tracker import Tracker, TrackingParameters

LEAST_PART = 0.25
"""Regions down to this share of ``min_area`` are used as parts of an object."""

OUTLINE = 4
"""Pixels around a region that are compared with it."""


@dataclass(frozen=True, slots=True)
class RobustParameters:
    """The parameters of ``RobustTracker``."""

    foreground: ForegroundParameters = field(default_factory=ForegroundParameters)
    tracking: TrackingParameters = field(default_factory=TrackingParameters)
    min_area: float = 0.0  # foreground of an object, square full-resolution pixels; 0: automatic
    least_share: float = LEAST_SHARE  # automatic: this share of the picture
    least_evidence: float = LEAST_EVIDENCE  # what stands and has less is a ghost
    least_change: float = 0.01  # share of a box: who stands there changes more within a second
    region: RegionLimits = field(default_factory=RegionLimits)
    max_area: float = math.inf  # regions above it are ignored, square full-resolution pixels
    convex: bool = False  # every object is convex: another region is several that touch


class RobustTracker(PipelineWithIds):
    """Tracks all moving objects of one camera.

    Attributes:
        parameters: May be set between two frames; the background and the tracks go on.
        regions: The regions of the last frame's foreground, in pixels of the mask.
    """

    def __init__(self, parameters: RobustParameters | None = None, first_id: int = 1) -> None:
        super().__init__(first_id)
        self.parameters = parameters or RobustParameters()
        self.regions: list[Region] = []
        self._tracker: Tracker | None = None

    def end_tracks(self) -> None:
        """End all tracks; the background stays."""
        self.tracks, self._main = [], None
        if self._tracker is not None:
            self._tracker.states = []

    def update(
        self, picture: Image, stamp_ns: int, size: tuple[int, int] | None = None
    ) -> list[Track]:
        """Process a frame and return the tracks at its stamp.

        Args:
            picture: (height, width, 3) uint8 BGR, the frame, or the frame reduced to at least
                1/n of its size, see ``working_scale``; not modified.
            stamp_ns: Its capture time. If that does not advance, no time passes.
            size: Width and height of the full frame; None if ``picture`` is the full frame. A
                change of the size begins new tracks and learns the background anew.
        """
        size = size or (picture.shape[1], picture.shape[0])
        if size != self._size:
            self._begin(size)
        assert self._tracker is not None
        now_s, tracker, wanted = self._pass_time(stamp_ns), self._tracker, self.parameters
        tracker.parameters = self._tracking()
        tracker.predict(now_s)
        picture, strong = self._subtract(picture, now_s, tracker.protected, wanted.foreground)
        least = self._least_area(wanted.min_area, wanted.least_share)
        if wanted.convex:
            self.mask = cut_at_concavities(self.mask, least)
        most = wanted.max_area / (self._scale * self._scale)
        self.regions = regions_of(self.mask, strong, LEAST_PART * least, most, wanted.region)
        found = tracker.update(self.regions, Scene(picture, self.mask))
        self.tracks = [each.moved(*self.shift) for each in found]
        assert self._foreground is not None
        for state in tracker.states:
            if state.born_s == now_s:
                state.came_in |= self._foreground.is_cut(state.origin, tracker.margin)
        if not wanted.foreground.frozen:
            self._absorb(picture, now_s, tracker)
        self._choose_main()
        return self.tracks

    def _absorb(self, picture: Image, now_s: float, tracker: Tracker) -> None:
        """Make ghosts, and what stands unchanged for long, part of the background."""
        assert self._foreground is not None
        background, mask = self._foreground.background, self.mask
        assert background is not None
        where, least = np.zeros_like(mask), self.parameters.least_change
        for state in tracker.suspects():
            box = state.shown or state.box
            left, top, right, bottom = (max(0, round(edge)) for edge in box[:4])
            if state.tested is not None and background.change(picture, *state.tested) > least:
                state.changed_s = now_s
            inside = slice(top, bottom), slice(left, right)
            state.tested = picture[inside].copy(), inside
            region = np.zeros_like(mask)
            region[top:bottom, left:right] = mask[top:bottom, left:right]
            window = (
                slice(max(0, top - OUTLINE), bottom + OUTLINE),
                slice(max(0, left - OUTLINE), right + OUTLINE),
            )
            found = evidence(
                picture[window],
                background.shown[window],
                region[window],
                mask[window],
            )
            if found < self.parameters.least_evidence or tracker.is_unchanged(state):
                tracker.drop(state)
                where[window] |= np.asarray(cv2.dilate(region[window], BAND), np.uint8)
        for box in tracker.protected():  # what was dropped is none of these any more
            left, top, right, bottom = (max(0, round(edge)) for edge in box[:4])
            where[top:bottom, left:right] = 0
        if where.any():
            with self._lock:
                background.absorb(picture, where)

    def _begin(self, size: tuple[int, int]) -> None:
        super()._begin(size)
        self._tracker = Tracker(self._tracking(), self._small_size(), self._scale, self.next_id)

    def _tracking(self) -> TrackingParameters:
        wanted = self.parameters
        return replace(
            wanted.tracking,
            min_area=self._least_area(wanted.min_area, wanted.least_share),
            convex=wanted.convex,
        )
