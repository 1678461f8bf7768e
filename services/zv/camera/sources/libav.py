"""Reads one video stream with libav, from a file or a URL, as pictures."""

from __future__ import annotations

import ctypes
import logging
import threading
import time
from collections import deque
from collections.abc import Iterator
from dataclasses import replace
from typing import Any, Final

import av
import numpy as np
from av.container import InputContainer
from av.error import FFmpegError
from av.packet import Packet
from av.stream import Disposition, Stream
from av.video.format import VideoFormat
from av.video.frame import VideoFrame
from av.video.plane import VideoPlane
from av.video.reformatter import ColorRange, VideoReformatter
from av.video.stream import VideoStream
from numpy.typing import NDArray

from zenoh_vision.image.codecs import MAX_COMPRESSED_BYTES
from zenoh_vision.image.pixel_formats import MAX_PIXELS, MAX_RAW_BYTES
from zenoh_vision.image.planar import PlanarForm, PlanarPicture, Plane, are_even
from zv.camera.sources.base import Picture, picture_of
from zv.camera.sources.mjpeg import DamagedJpeg, whole_jpeg
from zv.camera.sources.swscale import BgrWriter

log = logging.getLogger(__name__)

DEFAULT_RATE_HZ: Final = 25.0

MAX_BLOCK_BYTES: Final = MAX_RAW_BYTES + (1 << 20)
"""The largest block of memory that libav may take: the largest picture, with padding. If a
server sends no boundary, a packet has no end, and would otherwise grow until the time-out."""

PLANAR: Final = frozenset({"yuv420p", "yuvj420p"})
BT_601: Final = frozenset({2, 5, 6})  # not stated, BT.470 BG, SMPTE 170M
"""Colour spaces of JPEG; libav assumes one of these if a stream states none."""

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
        self._reformatter = VideoReformatter()
        self._bgr = BgrWriter()
        self._converting = threading.Lock()  # pixels may be requested by other threads
        self._asked: set[PlanarForm] = set()
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
                return self._decoded(self._frames.popleft())
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

    def _decoded(self, frame: VideoFrame) -> Picture:
        """Return a decoded frame, upright, as a picture.

        Planes that a JPEG can store are left as they are. Grey pictures keep their depth (9 to 15
        bits are scaled up to 16); alpha is kept. All others are converted to BGR by the stream's
        colour space and range; if the stream states neither, the result equals OpenCV's.
        """
        due_s = self._due_s(frame.time)
        stored = stored_planes(frame)
        if stored is None:
            return picture_of(self._pixels(frame), due_s=due_s)
        full_range = _is_full_range(frame)
        luma, blue, red = map(_array, stored)
        planar = PlanarPicture(
            (luma, blue, red),
            full_range=full_range,
            to_bgr=lambda: self._pixels(frame),
            write_bgr=self._bgr.of(stored, full_range=full_range),
            asked=lambda form: self._asked.add(form),  # to the set at the time of the call
        )
        forms, self._asked = tuple(self._asked), set()
        planar.prepare(forms)  # before they are requested, as they were of earlier pictures
        return Picture("bgr8", *planar.size, stored=planar, due_s=due_s)

    def _pixels(self, frame: VideoFrame) -> NDArray[Any]:
        wanted = _pixel_format(frame.format)
        with self._converting:
            converted = self._reformatter.reformat(
                frame, format=wanted, src_color_range=frame.color_range, threads=1
            )
        pixels = converted.to_ndarray()
        if frame.rotation % 90 == 0 and frame.rotation % 360:
            pixels = np.rot90(pixels, frame.rotation // 90)
        if converted is frame or not pixels.flags.c_contiguous:
            pixels = pixels.copy()  # the decoder may still need its own
        return pixels


def _pixel_format(source: VideoFormat) -> str:
    """Return libav's name of the pixel format to convert to."""
    components = source.components
    if any(component.is_alpha for component in components):
        return "bgra"
    if source.has_palette or source.is_rgb or len(components) != 1:
        return "bgr24"
    return "gray16le" if components[0].bits > 8 else "gray"


def stored_planes(frame: VideoFrame) -> tuple[VideoPlane, ...] | None:
    """Return the planes of a frame if a JPEG can store them; None if its colours are others."""
    if frame.format.name not in PLANAR or frame.colorspace not in BT_601 or frame.rotation % 360:
        return None
    if not are_even(frame.height, frame.width):
        return None
    planes = frame.planes  # each access makes new objects
    if any(plane.line_size < plane.width for plane in planes):  # rows from bottom to top
        return None
    return planes


def _array(plane: VideoPlane) -> Plane:
    """Return a view of a plane without the padding of its rows; it keeps the frame's memory."""
    shape, strides = (plane.height, plane.width), (plane.line_size, 1)
    return np.ndarray(shape, np.uint8, memoryview(plane), strides=strides)


def _is_full_range(frame: VideoFrame) -> bool:
    return frame.format.name == "yuvj420p" or frame.color_range == ColorRange.JPEG


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
