"""One video stream that libav reads, as pictures: for files and URLs alike."""

from __future__ import annotations

import logging
import time
from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

import av
from av.container import InputContainer
from av.error import FFmpegError
from av.packet import Packet
from av.stream import Disposition, Stream
from av.video.frame import VideoFrame
from av.video.reformatter import VideoReformatter
from av.video.stream import VideoStream

from services.camera.sources.base import Picture
from services.camera.sources.closing import Closing
from services.camera.sources.libav_pixels import pixels_of
from services.camera.sources.mjpeg import DamagedJpeg, whole_jpeg

log = logging.getLogger(__name__)

MAX_PIXELS: Final = 7680 * 4320
"""A stream that claims larger pictures is refused before memory is spent on them."""

TEXT_DECODERS: Final = frozenset({"ansi", "bintext", "xbin", "idf"})
"""libav draws any text file as a picture of a terminal; nobody means that."""


class NoVideo(Exception):
    """A container was opened, but has no video that can be decoded; the text says why."""


@dataclass(frozen=True, slots=True)
class Shot:
    """A picture and its time in the stream.

    Attributes:
        picture: Without ``due_s``, which only the reader of the stream can tell.
        time_s: Seconds on the stream's own clock, with any origin; None when it has no time.
    """

    picture: Picture
    time_s: float | None


class Footage:
    """An open video stream.

    ``close`` may be called while another thread is in ``read``: it then only leaves word, and
    the reading thread closes the container when its call to libav returns, which the time-outs
    bound. libav's memory is never freed under a running call.

    Args:
        location: ``file:`` and a path, or a URL.
        options: libav's, for the container.
        timeout_s: Longest time to open, and for the next picture; None for ever.
        live: Whether delay matters more than throughput.

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
        container = av.open(
            location,
            options=options,
            timeout=timeout_s,
            metadata_errors="replace",
        )
        try:
            self._stream = _video_stream(container)
        except NoVideo:
            container.close()
            raise
        self._closing = Closing(container.close)
        self._stream.codec_context.options = {"max_pixels": str(MAX_PIXELS)}
        self._stream.thread_type = "SLICE" if live else "AUTO"
        if live:
            self._stream.codec_context.flags |= av.codec.context.Flags.low_delay
        # All streams, so that sound alone cannot keep the loop in libav for ever.
        self._packets: Iterator[Packet[Stream]] = iter(container.demux())
        self._is_mjpeg = self._stream.codec_context.name == "mjpeg"
        self._frames: deque[VideoFrame] = deque()
        self._reformatter = VideoReformatter()
        self._warned = False
        rate = self._stream.average_rate or self._stream.guessed_rate
        self.rate_hz = float(rate) if rate else None
        self.has_end = container.duration is not None
        context = self._stream.codec_context
        size = f"{context.width}x{context.height}, " if context.width else ""
        self.summary = size + context.name.upper()

    @property
    def closed(self) -> bool:
        """Whether ``close`` was called."""
        return self._closing.closed

    def read(self) -> Shot | None:
        """Return the next picture, None at the end of the stream or after ``close``.

        Raises:
            FFmpegError: Reading failed.
            TimeoutError: No picture came within the time allowed.
        """
        with self._closing.using():
            return self._next()

    def close(self) -> None:
        """Close the stream, or have the thread that is reading close it."""
        self._closing.close()

    def _next(self) -> Shot | None:
        started_s = time.monotonic()
        while not self.closed:
            if self._frames:
                frame = self._frames.popleft()
                return Shot(self._decoded(frame), frame.time)
            packet = next(self._packets, None)
            if packet is None:
                return None
            if packet.stream.index == self._stream.index:
                shot = self._unpack(packet)
                if shot is not None:
                    return shot
            if self._timeout_s is not None and time.monotonic() - started_s > self._timeout_s:
                raise TimeoutError
        return None

    def _unpack(self, packet: Packet[Stream]) -> Shot | None:
        """Return a JPEG that needs no decoding; otherwise decode what a packet holds."""
        try:
            if self._is_mjpeg and packet.size:
                jpeg = whole_jpeg(bytes(packet))
                if jpeg is not None:
                    ticks = packet.pts if packet.pts is not None else packet.dts
                    time_s = None if ticks is None else float(ticks * packet.time_base)
                    picture = Picture(jpeg.encoding, jpeg.width, jpeg.height, jpeg=jpeg.data)
                    return Shot(picture, time_s)
            frames = [frame for frame in packet.decode() if isinstance(frame, VideoFrame)]
        except (DamagedJpeg, FFmpegError) as error:
            reason = getattr(error, "strerror", None) or str(error)
            level = logging.DEBUG if self._warned else logging.WARNING
            log.log(level, "a damaged packet of the video was left out: %s", reason)
            self._warned = True
            return None
        self._frames.extend(frame for frame in frames if not frame.is_corrupt)
        return None

    def _decoded(self, frame: VideoFrame) -> Picture:
        pixels, encoding = pixels_of(frame, self._reformatter)
        return Picture(encoding, pixels.shape[1], pixels.shape[0], pixels=pixels)


def _video_stream(container: InputContainer) -> VideoStream:
    streams = [
        stream
        for stream in container.streams.video
        if not stream.disposition & Disposition.attached_pic  # the cover of an album
    ]
    if not streams:
        raise NoVideo(
            "it has sound, but no video" if container.streams.audio else "it has no video"
        )
    stream = streams[0]
    if stream.codec_context is None:
        raise NoVideo("its video is of a kind that libav cannot decode")
    if stream.codec_context.name in TEXT_DECODERS:
        raise NoVideo("it is text")
    if stream.codec_context.width * stream.codec_context.height > MAX_PIXELS:
        size = f"{stream.codec_context.width}x{stream.codec_context.height}"
        raise NoVideo(f"its pictures are too large: {size}, at most {MAX_PIXELS} pixels")
    return stream
