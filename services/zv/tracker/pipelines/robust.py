"""Tracks all moving objects of a fixed camera: background subtraction, then tracking."""

from __future__ import annotations

import math
import threading
from dataclasses import dataclass, field, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from zv.tracker.foreground.concavities import cut_at_concavities
from zv.tracker.foreground.foreground import ForegroundDetector, ForegroundParameters
from zv.tracker.foreground.fragments import fragments_of
from zv.tracker.tracking.appearance import Scene
from zv.tracker.tracking.fragment import Fragment
from zv.tracker.tracking.track import Box, Track
from zv.tracker.tracking.tracker import Tracker, TrackingParameters

Image = NDArray[np.uint8]

WORKING_PIXELS = 384 * 288
LEAST_PART = 0.25
"""Regions down to this share of ``min_area`` are used as parts of an object."""

LARGER = 1.25
"""Hysteresis of the main track: it changes only to a track whose box is larger by this factor."""


@dataclass(frozen=True, slots=True)
class RobustParameters:
    """The parameters of ``RobustTracker``."""

    foreground: ForegroundParameters = field(default_factory=ForegroundParameters)
    tracking: TrackingParameters = field(default_factory=TrackingParameters)
    scale: int = 0  # n, to process frames at 1/n of their size; 0: working_scale
    min_area: float = 160.0  # foreground of an object, square full-resolution pixels
    max_area: float = math.inf  # regions above it are ignored, square full-resolution pixels
    convex: bool = False  # every object is convex: another region is several that touch


def working_scale(width: int, height: int) -> int:
    """Return n for processing frames of this size at 1/n of it: 2 at 768x576."""
    return max(1, round(math.sqrt(width * height / WORKING_PIXELS)))


class RobustTracker:
    """Tracks all moving objects of one camera.

    Args:
        parameters: Those of the foreground and of the tracking; None for the defaults.
        first_id: Id of the first track.

    Attributes:
        tracks: The tracks of the last frame, oldest first.
        mask: The foreground of the last frame, (height, width) uint8 of 0 and 255, at the reduced
            size; ``enlarged`` scales it to the size of the frame.
        scene_changed: Whether the light of the whole scene, or the view, changed with the last
            frame.
    """

    def __init__(self, parameters: RobustParameters | None = None, first_id: int = 1) -> None:
        self.parameters = parameters or RobustParameters()
        self.tracks: list[Track] = []
        self._fragments: list[Fragment] = []
        self.scene_changed = False
        self._first_id = first_id
        self._size: tuple[int, int] | None = None
        self._scale = 1
        self._detector: ForegroundDetector | None = None
        self._tracker: Tracker | None = None
        self.mask: Image = np.zeros((1, 1), np.uint8)
        self._lock = threading.Lock()
        self._main: int | None = None

    @property
    def next_id(self) -> int:
        """The id that the next new track gets."""
        return self._first_id if self._tracker is None else self._tracker.next_id

    def adjust(self, parameters: RobustParameters) -> None:
        """Continue with other parameters; keep the background and the tracks if possible."""
        if parameters == self.parameters:
            return
        if parameters.scale != self.parameters.scale:
            self._size = None
        self.parameters = parameters
        if self._detector is not None:
            self._detector.adjust(parameters.foreground)
        if self._tracker is not None:
            self._tracker.parameters = self._tracking()

    def reset(self) -> None:
        """Learn the background anew from the next frame on; the tracks go on."""
        if self._detector is not None:
            self._detector.reset()

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
        height, width = picture.shape[:2]
        size = size or (width, height)
        if size != self._size:
            self._begin(size)
        assert self._detector is not None
        assert self._tracker is not None
        small_size = -(-size[0] // self._scale), -(-size[1] // self._scale)
        if (width, height) != small_size:
            picture = np.asarray(
                cv2.resize(picture, small_size, interpolation=cv2.INTER_AREA), np.uint8
            )
        with self._lock:
            mask, self.scene_changed = self._detector.update(
                picture, stamp_ns, self._tracker.protected()
            )
        scale_area = self._scale * self._scale
        least = LEAST_PART * self.parameters.min_area / scale_area
        if self.parameters.convex:
            mask = cut_at_concavities(mask, self.parameters.min_area / scale_area)
        self._fragments = fragments_of(mask, least, self.parameters.max_area / scale_area)
        self.mask = mask
        scene = Scene(picture, mask, self._detector.changes, self._detector.counted_s)
        self.tracks = self._tracker.update(self._fragments, stamp_ns, scene)
        self._choose_main()
        return self.tracks

    @property
    def detections(self) -> list[tuple[Box, float]]:
        """The detections of the last frame: box and area, full-resolution pixels."""
        return [self._detection(each) for each in self._fragments]

    @property
    def centroid(self) -> Track | None:
        """The main object of the last frame: the largest confirmed track, with hysteresis.

        It changes to the confirmed track with the largest box if the current track is no longer
        confirmed, or if the largest box is larger than the current one's by a factor of 1.25.
        """
        return next((track for track in self.tracks if track.id == self._main), None)

    def background(self) -> Image:
        """Return the learned background, (height, width, 3) uint8 BGR; safe to call on any thread.

        Raises:
            ValueError: There was no frame yet.
        """
        with self._lock:
            if self._detector is None or self._size is None:
                raise ValueError("there was no frame yet")
            return np.asarray(cv2.resize(self._detector.background.picture(), self._size), np.uint8)

    def _begin(self, size: tuple[int, int]) -> None:
        first_id = self.next_id
        self._size = size
        self._scale = self.parameters.scale or working_scale(*size)
        self._detector = ForegroundDetector(self.parameters.foreground, self._scale)
        small_size = -(-size[0] // self._scale), -(-size[1] // self._scale)
        self._tracker = Tracker(self._tracking(), small_size, self._scale, first_id)
        self._main = None

    def _tracking(self) -> TrackingParameters:
        area = self.parameters.min_area / (self._scale * self._scale)
        return replace(self.parameters.tracking, min_area=area, convex=self.parameters.convex)

    def _detection(self, fragment: Fragment) -> tuple[Box, float]:
        scale = self._scale
        box = (
            round(fragment.left * scale),
            round(fragment.top * scale),
            round(fragment.width * scale),
            round(fragment.height * scale),
        )
        return box, fragment.area * scale * scale

    def _choose_main(self) -> None:
        areas = {
            track.id: track.box[2] * track.box[3]
            for track in self.tracks
            if track.state == "confirmed"
        }
        largest = max(areas, key=lambda number: (areas[number], -number), default=None)
        if largest is None:
            self._main = None
        elif self._main not in areas or areas[largest] > LARGER * areas[self._main]:
            self._main = largest


def enlarged(mask: Image, size: tuple[int, int]) -> Image:
    """Return a mask scaled to another size, width and height; its values stay 0 and 255."""
    return np.asarray(cv2.resize(mask, size, interpolation=cv2.INTER_NEAREST), np.uint8)
