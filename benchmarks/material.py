"""The input of the benchmarks: real frames, held in memory, at a steady rate."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import islice

import cv2
import numpy as np
from numpy.typing import NDArray

from benchmarks.quality.data import data_folder
from zenoh_vision.image.picture import PixelPicture
from zv.camera.sources.base import TimedPicture
from zv.camera.synthetic.source import Conditions, SyntheticSource

VIDEO = "vtest.avi"
FRAMES = 60
MOST_BYTES = 400_000_000
"""Of the frames in memory; 60 of 1920x1080 take less, and larger ones are fewer."""


def frames(width: int, height: int) -> list[NDArray[np.uint8]]:
    """Return frames of vtest.avi at a size; of the synthetic scene if the video does not exist."""
    number = min(FRAMES, MOST_BYTES // (3 * width * height))
    found = list(islice(video(width, height), number))
    if not found:
        print(f"# the synthetic scene instead of {VIDEO}, which is not in {data_folder()}")
        source = SyntheticSource((width, height), 1, Conditions)
        pictures = [source.read() for _ in range(number)]
        found = [np.asarray(p.picture.pixels, np.uint8) for p in pictures if p is not None]
    return found


def video(width: int, height: int) -> Iterator[NDArray[np.uint8]]:
    """Yield all frames of vtest.avi at a size; none if the video does not exist."""
    opened = cv2.VideoCapture(str(data_folder() / VIDEO))
    while opened.isOpened():
        read, frame = opened.read()
        if not read:
            break
        yield np.asarray(cv2.resize(frame, (width, height)), np.uint8)


class MemorySource:
    """Frames from memory, forth and back forever, so that reading costs nothing.

    Args:
        pictures: (height, width, 3) uint8 BGR each.
        rate_hz: How many a second.
    """

    live = False

    def __init__(self, pictures: list[NDArray[np.uint8]], rate_hz: float) -> None:
        self.rate_hz: float | None = rate_hz
        self.description = f"{len(pictures)} frames in memory"
        self._pictures = pictures
        self._period_s = 1.0 / rate_hz
        self._count = 0

    def read(self) -> TimedPicture:
        """Return the next frame, due a period after the one before."""
        turn = self._count % (2 * len(self._pictures) - 2)
        index = turn if turn < len(self._pictures) else 2 * len(self._pictures) - 2 - turn
        pixels = self._pictures[index]
        due_s = self._count * self._period_s
        self._count += 1
        return TimedPicture(PixelPicture(pixels), due_s=due_s)

    def close(self) -> None:
        """Do nothing: there is nothing to release."""
