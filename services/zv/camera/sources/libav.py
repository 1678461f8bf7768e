"""Reads one video stream with libav, from a file or a URL, as pictures."""

from __future__ import annotations

import ctypes
import logging
import time
from collections import deque
from collections.abc import Iterator
from dataclasses import replace
from typing import Final

import av
from av.container import InputContainer
from av.error import FFmpegError
from av.packet import Packet
from av.stream import Disposition, Stream
from av.video.frame import VideoFrame
from av.video.stream import VideoStream

from zenoh_vision.image.codecs import MAX_COMPRESSED_BYTES
from zenoh_vision.image.pixel_formats import MAX_PIXELS, MAX_RAW_BYTES
from zv.camera.sources.base import Picture
from zv.camera.sources.libav_frames import FrameConverter
from zv.camera.sources.mjpeg import DamagedJpeg, whole_jpeg

log = logging.getLogger(__name__)

DEFAULT_RATE_HZ: Final = 25.0

MAX_BLOCK_BYTES: Final = MAX_RAW_BYTES + (1 << 20)
"""The largest block of memory that libav may take: the largest picture, with padding. If a
server sends no boundary, a packet has no end, and would otherwise grow until the time-out."""

TEXT_DECODERS: Final = frozenset({"ansi", "bintext", "xbin", "idf"})
"""Codecs with which libav draws any text file as a picture of a terminal."""


def _limit_memory() -> None:
    """Set libav's limit for this process, which PyAV does not offer."""
    libav = ctypes.CDLL(av._core.__file__)  # finds the functions of libavutil, on which it depends
    if hasattr(libav, "av_max_alloc"):  # not on Windows
        libav.av_max_alloc(ctypes.c_size_t(MAX_BLOCK_BYTES))


_limit_memory()


class NoVideo(Exception):
    """A container was opened, but has no video that can be decoded; the text says why."""


class Timeline:
    """Computes when each picture of a recording is due, from the times in the recording.

    Args:
        rate_hz: Rate of pictures whose time is missing or runs backwards.
    """

    def __init__(self, rate_hz: float) -> None:
        self._period_s = 1.0 / rate_hz
        self._origin_s: float | None = None
        self._last_s = -self._period_s

    def due_s(self, time_s: float | None) -> float:
        """Return when the next picture is due, seconds since the first; never decreases.

        Args:
            time_s: Its time on the recording's clock, with any origin; None if it has none.
        """
        due_s = None if time_s is None or self._origin_s is None else time_s - self._origin_s
        if due_s is None or due_s < self._last_s:
            due_s = self._last_s + self._period_s
            # From here on the recording's clock is used again, if it has one.
            self._origin_s = None if time_s is None else time_s - due_s
        self._last_s = due_s
        return due_s


class AvStream:
    """An open video stream.

    Args:
        location: ``file:`` and a path, or a URL.
        options: libav's options for the container.
        timeout_s: Longest time to open it, and to wait for a picture; None for no limit.
        live: Whether short delay matters more than throughput, for a stream without an end.

    Attributes:
        live: Whether the stream has no end; its pictures then have no ``due_s``.
        rate_hz: The stream's own rate; None if it states none.
        summary: Size and codec, for people.

    Raises:
        FFmpegError: It cannot be opened.
        NoVideo: It is open, but has no video.
    """

    def __init__(
        self,
        location: str,
        *,
        options: dict[str, str] | None = None,
        timeout_s: float | None = None,
        live: bool = False,
    ) -> None:
        self._timeout_s = timeout_s
        container = av.open(location, options=options, timeout=timeout_s, metadata_errors="replace")
        try:
            self._stream = _video_stream(container)
        except NoVideo:
            container.close()
            raise
        self._container = container
        context = self._stream.codec_context
        context.options = {"max_pixels": str(MAX_PIXELS)}
        self._stream.thread_type = "SLICE" if live else "AUTO"
        if live:
            context.flags |= av.codec.context.Flags.low_delay
        # All streams, so that sound alone cannot keep the loop in libav forever.
        self._packets: Iterator[Packet[Stream]] = iter(container.demux())
        self._is_mjpeg = context.name == "mjpeg"
        self._frames: deque[VideoFrame] = deque()
        self._converter = FrameConverter()
        self._warned = False
        rate = self._stream.average_rate or self._stream.guessed_rate
        self.rate_hz = float(rate) if rate else None
        self.live = live and container.duration is None
        self._timeline = Timeline(self.rate_hz or DEFAULT_RATE_HZ)
        size = f"{context.width}x{context.height}, " if context.width else ""
        self.summary = f"{size}{context.name.upper()}"

    def read(self) -> Picture | None:
        """Return the next picture, None at the end of the stream or after ``close``.

        Raises:
            FFmpegError: Reading failed.
            TimeoutError: No picture came within the time limit.
        """
        started_s = time.monotonic()
        while True:
            if self._frames:
                frame = self._frames.popleft()
                return self._converter.picture(frame, self._due_s(frame.time))
            packet = next(self._packets, None)
            if packet is None:
                return None
            if packet.stream.index == self._stream.index and packet.size <= MAX_COMPRESSED_BYTES:
                picture = self._unpack(packet)
                if picture is not None:
                    return picture
            if self._timeout_s is not None and time.monotonic() - started_s > self._timeout_s:
                raise TimeoutError

    def close(self) -> None:
        """Close the stream; safe to call twice."""
        self._packets = iter(())
        self._frames.clear()
        self._container.close()

    def _unpack(self, packet: Packet[Stream]) -> Picture | None:
        """Return a JPEG that needs no decoding; otherwise decode the packet into ``_frames``."""
        try:
            if self._is_mjpeg and packet.size:
                jpeg = whole_jpeg(bytes(packet))
                if jpeg is not None:
                    ticks = packet.pts if packet.pts is not None else packet.dts
                    due_s = self._due_s(None if ticks is None else float(ticks * packet.time_base))
                    return replace(jpeg, due_s=due_s)
            frames = [frame for frame in packet.decode() if isinstance(frame, VideoFrame)]
        except (DamagedJpeg, FFmpegError) as error:
            reason = getattr(error, "strerror", None) or str(error)
            level = logging.DEBUG if self._warned else logging.WARNING
            log.log(level, "a damaged packet of the video was skipped: %s", reason)
            self._warned = True
            return None
        self._frames.extend(frame for frame in frames if not frame.is_corrupt)
        return None

    def _due_s(self, time_s: float | None) -> float | None:
        return None if self.live else self._timeline.due_s(time_s)


def _video_stream(container: InputContainer) -> VideoStream:
    streams = [
        stream
        for stream in container.streams.video
        if not stream.disposition & Disposition.attached_pic  # the cover of an album
    ]
    if not streams:
        sound = "sound, but " if container.streams.audio else ""
        raise NoVideo(f"it has {sound}no video")
    context = streams[0].codec_context
    if context is None:
        raise NoVideo("its video is of a kind that libav cannot decode")
    if context.name in TEXT_DECODERS:
        raise NoVideo("it is text")
    if context.width * context.height > MAX_PIXELS:
        size = f"{context.width}x{context.height}"
        raise NoVideo(f"its pictures are too large: {size}, at most {MAX_PIXELS} pixels")
    return streams[0]
