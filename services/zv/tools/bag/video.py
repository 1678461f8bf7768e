"""Writes the frames of a recording as a video, with their results drawn if wanted."""

from __future__ import annotations

from collections.abc import Iterable
from contextlib import suppress
from fractions import Fraction
from typing import IO, Any

import av
import cv2
from av.error import FFmpegError

from zenoh_vision.errors import ExpectationNotMet, PayloadError, SourceError
from zv.bag.frames import frame_of, results_of
from zv.bag.record import Record
from zv.bag.recording import Recording
from zv.tools.shared.drawing import draw

TICKS = 90_000
"""Units of time in a second, as is usual in MP4."""

CODECS = ("libx264", "mpeg4")


def write_video(
    recording: Recording,
    records: Iterable[Record],
    key: str,
    file: IO[bytes],
    *,
    draw_results: bool,
) -> tuple[int, int]:
    """Write an MP4 of frames at their times of capture, with tracks or else centroids if wanted.

    Returns:
        How many frames it has, and how many could not be read.

    Raises:
        SourceError: libav cannot make it.
        OSError: The file cannot be written.
        ExpectationNotMet: There is nothing to draw.
    """
    results = results_of(recording, key) if draw_results else None
    if draw_results and results is None:
        raise ExpectationNotMet(f"{recording.path} has neither tracks nor centroids of {key}")
    unread = 0
    try:
        with av.open(file, "w", format="mp4") as container:
            video = _Video(container)
            for record in records:
                frame, bgr = frame_of(record), None
                with suppress(PayloadError):
                    bgr = None if frame is None else frame.bgr
                if frame is None or bgr is None:
                    unread += not record.deleted
                    continue
                result = None if results is None else results.of(record)
                video.add(bgr if result is None else draw(bgr, result), frame.header.stamp_ns)
            video.end()
    except FFmpegError as error:
        if isinstance(error.__context__, OSError):  # of the file; libav knows only that it failed
            raise error.__context__ from None
        raise SourceError(f"cannot make a video of {recording.path}: {error.strerror}") from None
    return video.count, unread


class _Video:
    def __init__(self, container: Any) -> None:
        self.count = 0
        self._container = container
        self._stream: Any = None
        self._begin_ns = self._last = 0

    def add(self, bgr: Any, stamp_ns: int) -> None:
        height, width = bgr.shape[0] // 2 * 2, bgr.shape[1] // 2 * 2  # as the codec needs it
        if self._stream is None:
            self._begin_ns, self._last = stamp_ns, -1
            self._stream = _stream(self._container, width, height)
        elif (width, height) != (self._stream.width, self._stream.height):
            bgr = cv2.resize(bgr, (self._stream.width, self._stream.height))
            width, height = self._stream.width, self._stream.height
        frame = av.VideoFrame.from_ndarray(bgr[:height, :width].copy(), format="bgr24")
        # A clock that was set back must not make a file that no player plays.
        at = max(self._last + 1, (stamp_ns - self._begin_ns) * TICKS // 10**9)
        frame.pts, frame.time_base = at, Fraction(1, TICKS)
        self._last = at
        self._container.mux(self._stream.encode(frame))
        self.count += 1

    def end(self) -> None:
        if self._stream is not None:
            self._container.mux(self._stream.encode())


def _stream(container: Any, width: int, height: int) -> Any:
    for name in CODECS:
        if name in av.codecs_available:
            stream = container.add_stream(name, rate=Fraction(30))
            stream.width, stream.height, stream.pix_fmt = width, height, "yuv420p"
            stream.time_base = stream.codec_context.time_base = Fraction(1, TICKS)
            return stream
    raise SourceError(f"this build of libav has none of {', '.join(CODECS)}")
