"""Small videos and broken JPEGs for the tests of sources."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from pathlib import Path

import av
import cv2
import numpy as np
from av.audio.frame import AudioFrame
from av.video.frame import VideoFrame
from numpy.typing import NDArray

from zv.camera.sources.base import TimedPicture
from zv.camera.sources.video import VideoSource

WIDTH, HEIGHT = 64, 48
TICK = Fraction(1, 1000)


def level(index: int) -> int:
    """Return the grey level of picture ``index`` of a video made here."""
    return 20 + index * 10 % 220


def colour_bars(width: int = WIDTH, height: int = HEIGHT) -> NDArray[np.uint8]:
    """Return blue, green, red and white stripes, (height, width, 3) BGR; top half darker."""
    bars = np.zeros((height, width, 3), np.uint8)
    for index, colour in enumerate([(255, 0, 0), (0, 255, 0), (0, 0, 255), (255, 255, 255)]):
        bars[:, index * width // 4 : (index + 1) * width // 4] = colour
    bars[: height // 2] //= 2
    return bars


def make_video(
    path: Path,
    *,
    codec: str = "mpeg4",
    pixel_format: str = "yuv420p",
    frames: Sequence[NDArray[np.generic]] | int = 5,
    array_format: str = "bgr24",
    times_ms: Sequence[int] | None = None,
    rate: int = 10,
    options: dict[str, str] | None = None,
    tags: dict[str, int] | None = None,
) -> Path:
    """Write a video; ``frames`` as a number gives plain grey ones of ``level(i)``."""
    if isinstance(frames, int):
        frames = [np.full((HEIGHT, WIDTH, 3), level(index), np.uint8) for index in range(frames)]
    with av.open(str(path), "w", options=options or {}) as container:
        stream = container.add_stream(codec, rate=rate)
        rows, stream.width = frames[0].shape[:2]
        # 4:2:0 as one array has half as many rows of chroma below those of luma.
        stream.height = rows * 2 // 3 if array_format == "yuv420p" else rows
        stream.pix_fmt = pixel_format
        if times_ms is not None:
            stream.time_base = stream.codec_context.time_base = TICK
        if codec == "mpeg4":
            stream.codec_context.gop_size = 1
            stream.codec_context.bit_rate = 2_000_000
        if codec == "mjpeg":  # on one processor FFmpeg would choose tables of its own
            stream.codec_context.options = {"huffman": "default"}
        for name, value in (tags or {}).items():
            setattr(stream.codec_context, name, value)
        for index, array in enumerate(frames):
            frame = VideoFrame.from_ndarray(array, format=array_format)
            frame.pts = index if times_ms is None else times_ms[index]
            frame.time_base = Fraction(1, rate) if times_ms is None else TICK
            for packet in stream.encode(frame):
                container.mux(packet)
        for packet in stream.encode(None):
            container.mux(packet)
    return path


def make_sound(path: Path) -> Path:
    """Write a file that has sound and nothing else."""
    with av.open(str(path), "w") as container:
        stream = container.add_stream("pcm_s16le", rate=8000)
        frame = AudioFrame.from_ndarray(np.zeros((1, 800), np.int16), layout="mono")
        frame.sample_rate = 8000
        for packet in (*stream.encode(frame), *stream.encode(None)):
            container.mux(packet)
    return path


def jpeg_of(pixels: NDArray[np.uint8], *options: int) -> bytes:
    """Return pixels as a JPEG; ``options`` as for ``cv2.imencode``."""
    return cv2.imencode(".jpg", pixels, options)[1].tobytes()


def noise(*shape: int, depth: type[np.unsignedinteger] = np.uint8) -> NDArray[np.uint8]:
    """Return the same random pixels each time."""
    top = int(np.iinfo(depth).max) + 1
    return np.random.default_rng(7).integers(0, top, shape, depth)


def decoded(jpeg: bytes) -> NDArray[np.uint8]:
    """Return the pixels of a JPEG as OpenCV decodes it, unchanged."""
    pixels = cv2.imdecode(np.frombuffer(jpeg, np.uint8), cv2.IMREAD_UNCHANGED)
    assert pixels is not None
    return pixels


def with_orientation(jpeg: bytes, orientation: int, order: str = "little") -> bytes:
    """Return a JPEG with an Exif segment that tells how the camera was held."""

    def number(value: int, size: int) -> bytes:
        return value.to_bytes(size, "little" if order == "little" else "big")

    mark = b"II" if order == "little" else b"MM"
    entry = number(0x0112, 2) + number(3, 2) + number(1, 4) + number(orientation, 2) + bytes(2)
    tiff = mark + number(42, 2) + number(8, 4) + number(1, 2) + entry + bytes(4)
    body = b"Exif\0\0" + tiff
    return jpeg[:2] + b"\xff\xe1" + (len(body) + 2).to_bytes(2, "big") + body + jpeg[2:]


def pictures(path: Path) -> list[TimedPicture]:
    """Return all pictures of a video file."""
    source = VideoSource(path)
    try:
        return list(iter(source.read, None))
    finally:
        source.close()


def shown(timed: TimedPicture) -> NDArray[np.generic]:
    """Return the pixels of a source's picture."""
    return timed.picture.pixels
