"""Reads a video file at its own pace."""

from __future__ import annotations

import logging
import os
from pathlib import Path

import av
from av.error import FFmpegError

from zenoh_vision.errors import SourceError
from zv.camera.sources.base import TimedPicture
from zv.camera.sources.libav import DEFAULT_RATE_HZ, NoVideo
from zv.camera.sources.recording import Recording

log = logging.getLogger(__name__)


class VideoSource:
    """Pictures of a video file, as libav reads it.

    MJPEG is passed on undecoded. A truncated or damaged file delivers the pictures before the
    damage and then ends normally with a warning, since reading it again would not help.
    Files are read with PyAV because OpenCV 5.0 aborts the process on some.

    Args:
        path: A regular file, as ``kind_of`` found.
        video_stream: Which of several videos, from 0.

    Raises:
        SourceError: It is not a readable file, or not a video.
    """

    live = False

    def __init__(self, path: Path | str, video_stream: int = 0) -> None:
        self._path = Path(path)
        if not os.access(self._path, os.R_OK):
            raise SourceError(f"{path}: no permission to read it")
        if not self._path.stat().st_size:
            raise SourceError(f"{path}: the file is empty")
        try:
            # The prefix "file:" prevents that a colon in the name ends a protocol.
            container = av.open(f"file:{self._path}", metadata_errors="replace")
        except FFmpegError as error:
            raise SourceError(
                f"{path}: not a video that can be read, or cut short: {error.strerror}"
            ) from None
        try:
            self._recording = Recording(container, number=video_stream)
        except NoVideo as error:
            container.close()
            raise SourceError(f"{path}: not a video: {error}") from None
        self.rate_hz: float | None = self._recording.rate_hz or DEFAULT_RATE_HZ
        self.description = (
            f"video file {self._path.name} ({self._recording.summary}, {self.rate_hz:.4g} Hz)"
        )
        self._pictures = 0

    def read(self) -> TimedPicture | None:
        """Return the next picture, or None at the end of the file."""
        try:
            picture = self._recording.read()
        except FFmpegError as error:
            damage = f"damaged or cut short after {self._pictures} pictures"
            log.warning("%s: %s: %s", self._path, damage, error.strerror)
            return None
        self._pictures += 1
        return picture

    def close(self) -> None:
        """Close the file; safe to call twice."""
        self._recording.close()
