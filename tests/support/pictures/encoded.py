"""Pictures for the tests, PNGs chunk by chunk, and pictures that are broken in one way each."""

from __future__ import annotations

import struct
import zlib
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from zenoh_vision.image import codecs
from zenoh_vision.image.pixel_formats import ENCODINGS

WIDTH, HEIGHT = 320, 240
SIDE = 40


def scene(step: int | None) -> NDArray[np.uint8]:
    """Return a still background, with a bright square at a step of its way, or without."""
    noise = np.random.default_rng(1).integers(40, 90, (HEIGHT // 8, WIDTH // 8, 3), np.uint8)
    picture = cv2.resize(noise, (WIDTH, HEIGHT), interpolation=cv2.INTER_LINEAR)
    if step is not None:
        x, y = 10 + 6 * (step % 40), 100
        picture[y : y + SIDE, x : x + SIDE] = (250, 240, 230)
    return np.asarray(picture, np.uint8)


def noise(encoding: str, width: int, height: int) -> NDArray[Any]:
    """Return random pixels in an encoding."""
    known = ENCODINGS[encoding]
    shape = (height, width) if known.channels == 1 else (height, width, known.channels)
    random = np.random.default_rng(3)
    if known.dtype.kind == "f":
        return random.random(shape, np.float32) * 10
    return random.integers(0, int(np.iinfo(known.dtype).max) + 1, shape, known.dtype)


def jpeg(pixels: NDArray[np.uint8], quality: int = 90) -> bytes:
    """Return a JPEG, by OpenCV."""
    return bytes(cv2.imencode(".jpg", pixels, [cv2.IMWRITE_JPEG_QUALITY, quality])[1])


def size_of(picture: bytes) -> tuple[int, int]:
    """Return width and height of one of these JPEGs, 1 x 1 if it is none."""
    place = picture.find(b"\xff\xc0")
    if place < 0 or len(picture) < place + 9:
        return 1, 1
    height, width = struct.unpack(">HH", picture[place + 5 : place + 9])
    return width, height


def forged_size(picture: bytes, width: int, height: int) -> bytes:
    """Return the JPEG with another size in its frame header."""
    place = picture.index(b"\xff\xc0") + 5
    return picture[:place] + struct.pack(">HH", height, width) + picture[place + 4 :]


def progressive(scans: int, width: int = 64, height: int = 48) -> bytes:
    """Return a flawless progressive JPEG that claims a size; its last scan is repeated.

    The repetitions send all bits of luma anew (Ah = Al = 0) instead of the last ones.
    """
    options = [cv2.IMWRITE_JPEG_PROGRESSIVE, 1]
    jpeg = bytes(cv2.imencode(".jpg", np.full((48, 64, 3), 90, np.uint8), options)[1])
    at = jpeg.index(b"\xff\xc2") + 5
    jpeg = jpeg[:at] + struct.pack(">HH", height, width) + jpeg[at + 4 :]
    own, last = jpeg.count(b"\xff\xda"), jpeg.rindex(b"\xff\xda")
    again = jpeg[last : last + 9] + b"\0" + jpeg[last + 10 : -2]
    return jpeg[:-2] + (scans - own) * again + jpeg[-2:]


def damaged(picture: bytes) -> bytes:
    """Return the JPEG with its entropy-coded data damaged in the middle: most decoders show it."""
    middle = len(picture) * 2 // 3
    broken = picture[:middle] + b"\xff\x00\xff\x00\xaa\x55" * 40 + picture[middle + 240 :]
    assert cv2.imdecode(np.frombuffer(broken, np.uint8), cv2.IMREAD_COLOR) is not None
    return broken


def write_video(path: Path, *, frames: int, rate_hz: float) -> Path:
    """Write a Motion JPEG video of the moving square, and return its path."""
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"MJPG"), rate_hz, (WIDTH, HEIGHT))
    assert writer.isOpened()
    for step in range(frames):
        writer.write(scene(step))
    writer.release()
    return path


STILL = jpeg(scene(None))
PICTURES = tuple(jpeg(scene(step)) for step in range(40))


def smooth(width: int, height: int, *, detail: int = 8) -> NDArray[np.uint8]:
    """Return a colour scene that JPEG keeps well, with enough contrast that a shift shows."""
    coarse = np.random.default_rng(1).integers(
        0, 256, (height // detail, width // detail, 3), np.uint8
    )
    return np.asarray(cv2.resize(coarse, (width, height), interpolation=cv2.INTER_CUBIC), np.uint8)


SCENE = smooth(64, 48)


def png_of(*chunks: tuple[bytes, bytes]) -> bytes:
    """Return a PNG of chunks, each a kind and its content, with right checksums."""
    return codecs.PNG_START + b"".join(
        struct.pack(">I", len(content))
        + kind
        + content
        + struct.pack(">I", zlib.crc32(kind + content))
        for kind, content in chunks
    )


def chunks_of(png: bytes) -> list[tuple[bytes, bytes]]:
    """Return the kind and content of each chunk."""
    found, at = [], len(codecs.PNG_START)
    while at < len(png):
        length, kind = struct.unpack(">I4s", png[at : at + 8])
        found.append((kind, png[at + 8 : at + 8 + length]))
        at += 12 + length
    return found
