"""Reads a video file at its own pace."""

from __future__ import annotations

import logging
import os
from pathlib import Path

from av.error import FFmpegError

from zenoh_vision.errors import SourceError
from zv.camera.sources.base import Picture
from zv.camera.sources.libav import DEFAULT_RATE_HZ, AvStream, NoVideo

log = logging.getLogger(__name__)


class VideoSource(AvStream):
    """Pictures of a video file, as libav reads it.

    MJPEG is passed on undecoded. A truncated or damaged file delivers the pictures before the
    damage and then ends normally with a warning, since reading it again would not help.
    Files are read with PyAV because OpenCV 5.0 aborts the process on some.

    Args:
        path: A regular file, as ``kind_of`` found.

    Raises:
        SourceError: It is not a readable file, or not a video.
    """

    def __init__(self, path: Path | str) -> None:
        self._path = Path(path)
        if not os.access(self._path, os.R_OK):
            raise SourceError(f"{path}: no permission to read it")
        if not self._path.stat().st_size:
            raise SourceError(f"{path}: the file is empty")
        try:
            # The prefix "file:" prevents that a colon in the name ends a protocol.
            super().__init__(f"file:{self._path}")
        except NoVideo as error:
            raise SourceError(f"{path}: not a video: {error}") from None
        except FFmpegError as error:
            raise SourceError(
                f"{path}: not a video that can be read, or cut short: {error.strerror}"
            ) from None
        self.rate_hz = self.rate_hz or DEFAULT_RATE_HZ
        self.description = f"video file {self._path.name} ({self.summary}, {self.rate_hz:.4g} Hz)"
        self._pictures = 0

    def read(self) -> Picture | None:
        """Return the next picture, or None at the end of the file."""
        try:
            picture = super().read()
        except FFmpegError as error:
            damage = f"damaged or cut short after {self._pictures} pictures"
            log.warning("%s: %s: %s", self._path, damage, error.strerror)
            return None
        self._pictures += 1
        return picture
