"""What the pipelines with ids have in common: a clock, background subtraction, a main object."""

from __future__ import annotations

import math
import threading
from collections.abc import Callable, Sequence
from typing import Any, Final

import cv2
import numpy as np
from numpy.typing import NDArray

from zv.tracker.foreground.foreground import ForegroundDetector, ForegroundParameters
from zv.tracker.foreground.steadying import moved_back
from zv.tracker.foreground.view import Shown
from zv.tracker.tracking.base import TrackerBase
from zv.tracker.tracking.region import Region
from zv.tracker.tracking.track import Track

Image = NDArray[np.uint8]

WORKING_PIXELS: Final = 125_000
LEAST_SHARE: Final = 0.0008
"""Least foreground of an object, as a share of the picture."""

LARGER: Final = 1.25
"""The main object changes only to one whose box is larger by this factor."""

UNSEEN_S: Final = 0.3
"""It stays the main object, where it is expected, while it is not seen for at most this time."""


def working_scale(width: int, height: int) -> int:
    """Return n for processing frames of this size at 1/n of it: 2 at 768x576."""
    return max(1, round(math.sqrt(width * height / WORKING_PIXELS)))


class PipelineWithIds:
    """The base of both pipelines.

    Attributes:
        tracks: The tracks of the last frame, oldest first, in pixels of the frame.
        mask: The foreground of the last frame, (height, width) uint8 of 0 and 255, at the reduced
            size, where the background is; ``enlarged`` makes it that of the frame.
        shown: What the last frame shows: ``nothing`` while the lens is covered; ``other`` when
            the camera has moved: once, or without learning for as long as that is so.
    """

    def __init__(self, first_id: int) -> None:
        self.tracks: list[Track] = []
        self.mask: Image = np.zeros((1, 1), np.uint8)
        self.shown: Shown = "scene"
        self._size: tuple[int, int] | None = None
        self._scale = 1
        self._foreground: ForegroundDetector | None = None
        self._lock = threading.Lock()  # a query may want the background
        self._stamp_ns: int | None = None
        self._now_ns = 0
        self._main: int | None = None
        self._first_id = first_id
        self._tracker: TrackerBase[Any] | None = None

    @property
    def next_id(self) -> int:
        """The id that the next new track gets."""
        return self._first_id if self._tracker is None else self._tracker.next_id

    @property
    def has_background(self) -> bool:
        """Whether a background is learned."""
        return self._foreground is not None

    @property
    def blind(self) -> bool:
        """Whether the regions leave nothing of the last frame where objects are detected."""
        return self._foreground is not None and self._foreground.blind

    @property
    def moved(self) -> tuple[int, int]:
        """By how many pixels of the mask, x and y, the last frame was moved from the background."""
        return (0, 0) if self._foreground is None else self._foreground.moved

    @property
    def shift(self) -> tuple[int, int]:
        """By how many pixels of the frame, x and y, it was moved from the background."""
        return self.moved[0] * self._scale, self.moved[1] * self._scale

    @property
    def still(self) -> list[Track]:
        """The tracks at their places in the background, where shapes and a calibration hold.

        So nothing that stands crosses a line because the camera shakes.
        """
        right, down = self.shift
        return [each.moved(-right, -down) for each in self.tracks]

    @property
    def centroid(self) -> Track | None:
        """The main object of the last frame: the largest confirmed track, with hysteresis."""
        return next((each for each in self.tracks if each.id == self._main), None)

    def reset(self) -> None:
        """Learn the background anew from the next frame on; the tracks go on."""
        with self._lock:
            if self._foreground is not None:
                self._foreground.reset()

    def background(self) -> Image:
        """Return the learned background, (height, width, 3) uint8 BGR; safe to call on any thread.

        Raises:
            ValueError: There was no frame yet, or background subtraction does not run.
        """
        with self._lock:
            learned = None if self._foreground is None else self._foreground.background
            if learned is None or self._size is None:
                raise ValueError("there was no frame yet, or no background is learned")
            return np.asarray(cv2.resize(learned.shown, self._size), np.uint8)

    def _begin(self, size: tuple[int, int]) -> None:
        """Begin with frames of another size: learn the background anew."""
        with self._lock:
            self._size, self._scale, self._foreground = size, working_scale(*size), None
        self._main = None

    def _pass_time(self, stamp_ns: int) -> float:
        """Return the seconds by which the stamps have advanced; a step back is no time."""
        if self._stamp_ns is not None:
            self._now_ns += max(0, stamp_ns - self._stamp_ns)
        self._stamp_ns = stamp_ns
        return self._now_ns / 1e9

    def _small_size(self) -> tuple[int, int]:
        assert self._size is not None
        return -(-self._size[0] // self._scale), -(-self._size[1] // self._scale)

    def _subtract(
        self,
        picture: Image,
        now_s: float,
        known: Callable[[], Sequence[Region]],
        parameters: ForegroundParameters,
    ) -> tuple[Image, Image]:
        """Find the foreground of a frame, and learn from it.

        Args:
            picture: The frame, at any size.
            now_s: Its time.
            known: Returns the boxes of known objects, where the background is; ``moved`` is known.
            parameters: Those of the foreground.

        Returns:
            The picture at the reduced size, where the background is, and the strong pixels of its
            foreground.
        """
        if picture.shape[1::-1] != self._small_size():
            small = cv2.resize(picture, self._small_size(), interpolation=cv2.INTER_AREA)
            picture = np.asarray(small, np.uint8)
        with self._lock:
            if self._foreground is None:
                self._foreground = ForegroundDetector(parameters, self._scale)
            self._foreground.parameters = parameters
            picture = self._foreground.steadied(picture)
            self.mask, strong, self.shown = self._foreground.update(picture, now_s, known())
        return picture, strong

    def _least_area(self, min_area: float, share: float = LEAST_SHARE) -> float:
        """Return the least foreground of an object, square pixels of the mask.

        Args:
            min_area: The same in full-resolution pixels; 0: a share of the picture.
            share: That share.
        """
        assert self._size is not None
        full = min_area or share * self._size[0] * self._size[1]
        return full / (self._scale * self._scale)

    def _choose_main(self) -> None:
        """Choose the main object of the tracks."""
        areas = {
            each.id: each.box[2] * each.box[3]
            for each in self.tracks
            if each.state == "confirmed" or (each.id == self._main and each.missing_s <= UNSEEN_S)
        }
        largest = max(areas, key=lambda number: (areas[number], -number), default=None)
        if largest is None:
            self._main = None
        elif self._main not in areas or areas[largest] > LARGER * areas[self._main]:
            self._main = largest


def enlarged(mask: Image, size: tuple[int, int], moved: tuple[int, int] = (0, 0)) -> Image:
    """Return a mask moved to where its frame shows it, and scaled to the size of the frame.

    Args:
        mask: (height, width) uint8 of 0 and 255; so is what is returned.
        size: Width and height of the frame.
        moved: By how many pixels of the mask, x and y, the frame was moved from the background.
    """
    mask = moved_back(mask, (-moved[0], -moved[1]))
    return np.asarray(cv2.resize(mask, size, interpolation=cv2.INTER_NEAREST), np.uint8)
