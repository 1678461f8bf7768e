"""A video file, at its own pace."""

from __future__ import annotations

import logging
import os
from dataclasses import replace
from pathlib import Path

from av.error import FFmpegError

from common.errors import SourceError
from services.camera.sources.base import Picture
from services.camera.sources.libav import Footage, NoVideo, Shot

log = logging.getLogger(__name__)

DEFAULT_RATE_HZ = 25.0


class Timeline:
    """When each picture of a file is due, from the times that the file gives.

    Args:
        rate_hz: What pictures without a time, or with one that runs backwards, are spaced by.
    """

    def __init__(self, rate_hz: float) -> None:
        self._period_s = 1.0 / rate_hz
        self._origin_s: float | None = None
        self._last_s: float | None = None

    def due_s(self, time_s: float | None) -> float:
        """Return when the next picture is due, seconds since the first; never falls."""
        if self._last_s is None:
            due_s = 0.0
        elif time_s is None or self._origin_s is None or time_s - self._origin_s < self._last_s:
            due_s = self._last_s + self._period_s
            self._origin_s = None
        else:
            due_s = time_s - self._origin_s
        if self._origin_s is None and time_s is not None:
            self._origin_s = time_s - due_s  # from here on its clock holds (again)
        self._last_s = due_s
        return due_s


def timed(shot: Shot, timeline: Timeline) -> Picture:
    """Return a shot's picture with the time when it is due."""
    return replace(shot.picture, due_s=timeline.due_s(shot.time_s))


class VideoSource:
    """Pictures of a video file, as libav reads it.

    MJPEG comes through undecoded. A file that is cut short or damaged gives the pictures
    before that place and then ends as a whole one does, with a warning: reading it again would
    not help. Files are read with PyAV because OpenCV 5.0 aborts the process on some.

    Args:
        path: The file.

    Raises:
        SourceError: It is no readable file, or no video.
    """

    live = False

    def __init__(self, path: Path | str) -> None:
        self._path = Path(path)
        _check(self._path)
        try:
            # With the protocol named, a colon in the file's name is not taken for one.
            self._footage = Footage(f"file:{self._path}")
        except NoVideo as error:
            raise SourceError(f"{self._path}: not a video: {error}") from None
        except FFmpegError as error:
            raise SourceError(
                f"{self._path}: not a video that can be read, or cut short: {error.strerror}"
            ) from None
        self.rate_hz: float | None = self._footage.rate_hz or DEFAULT_RATE_HZ
        self._timeline = Timeline(self.rate_hz)
        self._pictures = 0
        self.description = (
            f"video file {self._path.name} ({self._footage.summary}, {self.rate_hz:.4g} Hz)"
        )

    def read(self) -> Picture | None:
        """Return the next picture, or None at the end of the file."""
        try:
            shot = self._footage.read()
        except FFmpegError as error:
            log.warning(
                "%s: damaged or cut short after %d pictures: %s",
                self._path,
                self._pictures,
                error.strerror,
            )
            return None
        if shot is None:
            return None
        self._pictures += 1
        return timed(shot, self._timeline)

    def close(self) -> None:
        """Close the file; safe to call twice, and while another thread reads."""
        self._footage.close()


def _check(path: Path) -> None:
    if path.is_dir():
        raise SourceError(f"{path}: a folder, not a video file")
    if not path.exists():
        raise SourceError(f"{path}: no such file")
    if not path.is_file():
        raise SourceError(f"{path}: not a regular file")
    if not os.access(path, os.R_OK):
        raise SourceError(f"{path}: you may not read it; its permissions are missing for you")
    if not path.stat().st_size:
        raise SourceError(f"{path}: the file is empty")
