"""Pictures that tests share: a smooth scene, and PNGs chunk by chunk."""

from __future__ import annotations

import struct
import zlib

import cv2
import numpy as np
from numpy.typing import NDArray

from common import images


def smooth(width: int, height: int, *, detail: int = 8) -> NDArray[np.uint8]:
    """Return a colour scene that JPEG keeps well, with enough contrast that a shift shows."""
    coarse = np.random.default_rng(1).integers(
        0, 256, (height // detail, width // detail, 3), np.uint8
    )
    return np.asarray(cv2.resize(coarse, (width, height), interpolation=cv2.INTER_CUBIC), np.uint8)


SCENE = smooth(64, 48)


def png_of(*chunks: tuple[bytes, bytes]) -> bytes:
    """Return a PNG of chunks, each a kind and its content, with right checksums."""
    return images.PNG_START + b"".join(
        struct.pack(">I", len(content))
        + kind
        + content
        + struct.pack(">I", zlib.crc32(kind + content))
        for kind, content in chunks
    )


def chunks_of(png: bytes) -> list[tuple[bytes, bytes]]:
    """Return the kind and content of each chunk."""
    found, at = [], len(images.PNG_START)
    while at < len(png):
        length, kind = struct.unpack(">I4s", png[at : at + 8])
        found.append((kind, png[at + 8 : at + 8 + length]))
        at += 12 + length
    return found
