"""Opens a container with libav, finds its video, and decodes its packets to pictures."""

from __future__ import annotations

import ctypes
import logging
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

import av
from av.container import InputContainer
from av.error import FFmpegError
from av.packet import Packet
from av.stream import Disposition, Stream
from av.video.frame import VideoFrame
from av.video.stream import VideoStream

from zenoh_vision.image.codecs import MAX_COMPRESSED_BYTES
from zenoh_vision.image.limits import MAX_PIXELS, MAX_RAW_BYTES
from zenoh_vision.image.picture import JpegPicture, Picture
from zv.camera.sources.libav_frames import FrameConverter
from zv.camera.sources.mjpeg import DamagedJpeg, upright_jpeg

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


@dataclass(frozen=True, slots=True)
class Decoded:
    """A decoded picture, and its time on the stream's clock; None if it has none."""

    picture: Picture
    time_s: float | None


def packet_time_s(packet: Packet[Stream]) -> float | None:
    """Return the presentation time of a packet on the stream's clock, else its decoding time."""
    ticks = packet.pts if packet.pts is not None else packet.dts
    return None if ticks is None else float(ticks * packet.time_base)


class VideoDecoder:
    """Decodes the packets of a stream; JPEGs stay as they are.

    Args:
        stream: That of an open container.
        low_delay: Whether short delay matters more than throughput.

    Attributes:
        rate_hz: The stream's own rate; None if it states none.
        summary: Size and codec, for people.
    """

    def __init__(self, stream: VideoStream, *, low_delay: bool) -> None:
        self._stream = stream
        context = stream.codec_context
        context.options = {"max_pixels": str(MAX_PIXELS)}
        stream.thread_type = "SLICE" if low_delay else "AUTO"
        if low_delay:
            context.flags |= av.codec.context.Flags.low_delay
        self._is_mjpeg = context.name == "mjpeg"
        self._is_turned: bool | None = None
        self._converter = FrameConverter()
        self._warned = False
        self._damaged = 0
        rate = stream.average_rate or stream.guessed_rate
        self.rate_hz = float(rate) if rate else None
        size = f"{context.width}x{context.height}, " if context.width else ""
        self.summary = f"{size}{_aspect_words(stream)}{context.name.upper()}"

    def decode(self, packet: Packet[Stream]) -> Iterator[Decoded]:
        """Yield the pictures that are complete with a packet; none if it is damaged."""
        if packet.stream.index != self._stream.index or packet.size > MAX_COMPRESSED_BYTES:
            return
        try:
            if self._is_mjpeg and packet.size and self._is_turned is not True:
                jpeg = upright_jpeg(bytes(packet))
                is_file = isinstance(jpeg, JpegPicture)
                if jpeg is not None and not (is_file and self._turns(packet)):
                    yield Decoded(jpeg, packet_time_s(packet))
                    return
            frames = [frame for frame in packet.decode() if isinstance(frame, VideoFrame)]
        except (DamagedJpeg, FFmpegError) as error:
            reason = getattr(error, "strerror", None) or str(error)
            level = logging.DEBUG if self._warned else logging.WARNING
            log.log(level, "a damaged packet of the video was skipped: %s", reason)
            self._warned = True
            self._damaged += 1
            return
        for frame in frames:
            if frame.is_corrupt:
                self._damaged += 1
            else:
                yield Decoded(self._converter.picture(frame), frame.time)

    def taken_damaged(self) -> int:
        """Return how many pictures were left out as damaged since the last call."""
        count, self._damaged = self._damaged, 0
        return count

    def forget(self) -> None:
        """Forget the pictures that are not complete: the next packet is a key picture."""
        self._stream.codec_context.flush_buffers()

    def _turns(self, packet: Packet[Stream]) -> bool:
        """Tell whether the container says that the video must be turned, as phones do."""
        if self._is_turned is None:
            frames = [*packet.decode(), *self._stream.codec_context.decode(None)]
            self._is_turned = any(
                isinstance(frame, VideoFrame) and frame.rotation % 360 for frame in frames
            )
            self.forget()
        return self._is_turned


def video_stream(container: InputContainer, number: int = 0) -> VideoStream:
    """Return the video of an open container, by its number among the videos, from 0.

    Raises:
        NoVideo: It has none, none of this number, or one that cannot be decoded.
    """
    streams = [
        stream
        for stream in container.streams.video
        if not stream.disposition & Disposition.attached_pic  # the cover of an album
    ]
    if not streams:
        sound = "sound, but " if container.streams.audio else ""
        raise NoVideo(f"it has {sound}no video")
    if number >= len(streams):
        raise NoVideo(f"video_stream = {number}, but its last video is number {len(streams) - 1}")
    if len(streams) > 1:
        sizes = (f"{stream.width}x{stream.height}" for stream in streams)
        log.info("it has %d videos: %s; number %d is shown", len(streams), ", ".join(sizes), number)
    stream = streams[number]
    context = stream.codec_context
    if context is None:
        raise NoVideo("its video is of a kind that libav cannot decode")
    if context.name in TEXT_DECODERS:
        raise NoVideo("it is text")
    if context.width * context.height > MAX_PIXELS:
        size = f"{context.width}x{context.height}"
        raise NoVideo(f"its pictures are too large: {size}, at most {MAX_PIXELS} pixels")
    return stream


def _aspect_words(stream: VideoStream) -> str:
    """Return what to say of pixels that are not square, which are published as they are stored."""
    aspect = stream.sample_aspect_ratio or stream.codec_context.sample_aspect_ratio
    if not aspect or aspect == 1:
        return ""
    log.warning(
        "the pixels of the video are not square but %d:%d, and are published as stored: "
        "angles and distances are distorted without a calibration",
        aspect.numerator,
        aspect.denominator,
    )
    return f"pixels {aspect.numerator}:{aspect.denominator}, "
