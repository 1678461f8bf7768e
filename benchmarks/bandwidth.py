"""Bandwidth of streams: ``python -m benchmarks.bandwidth [FILE|FOLDER|WIDTHxHEIGHT ...]``.

Encodes pictures of the synthetic scene, or those of a file or folder, with each quality, and
prints a Markdown table: kB (of 1000 bytes) a frame, and frames a second for each Mbit/s.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Sequence
from itertools import islice
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from zenoh_vision.errors import VisionError
from zenoh_vision.image.codecs import encode_jpeg
from zv.camera.settings import CameraSettings
from zv.camera.source_policy import SourceOpener
from zv.camera.synthetic.scene import Scene

SIZES = ("320x240", "640x480", "1280x720", "1920x1080", "3840x2160")
QUALITIES = (50, 65, 80, 90, 95)
FRAMES = 8
APART = 40  # frames: so that the objects are elsewhere in each
RATE_HZ = 30.0
ON_THE_WIRE = 1.06
"""Bytes on the wire for each of JPEG, with Zenoh, TCP, IP and Ethernet: 1.04 to 1.06 measured."""


def scene(width: int, height: int) -> list[NDArray[np.uint8]]:
    """Return pictures that the synthetic camera shows by default, (height, width, 3) BGR."""
    given = CameraSettings()
    made = Scene(width, height, RATE_HZ, given.seed, given.noise, given.objects)
    return [made.frame(number * APART, 1.0)[0] for number in range(FRAMES)]


def material(source: str) -> list[NDArray[np.uint8]]:
    """Return some pictures of a file or folder, at equal distances."""
    if source == "synthetic":
        sys.exit("for the synthetic scene name sizes, or nothing")
    settings = CameraSettings(source=source)
    opened = SourceOpener()(settings, lambda: settings)
    pictures = islice(iter(opened.read, None), 0, FRAMES * APART, APART)
    return [each.picture.in_8_bits("bgr8") for each in pictures]


def kilobytes(pictures: Sequence[NDArray[np.uint8]]) -> list[float]:
    """Return the mean size of a picture as JPEG, one for each quality."""
    return [
        float(np.mean([len(encode_jpeg(picture, "bgr8", quality)) for picture in pictures])) / 1e3
        for quality in QUALITIES
    ]


def frames_per_mbit(size_kb: float) -> float:
    """Return how many frames of a size pass in a second for each Mbit/s of the link."""
    return 1e6 / (8 * size_kb * 1e3 * ON_THE_WIRE)


def short(value: float, digits: int) -> str:
    """Return a number with this many significant digits, without exponent."""
    return f"{float(f'{value:.{digits}g}'):g}"


def row(name: str, sizes_kb: Sequence[float]) -> str:
    """Return a line of the table."""
    cells = (f"{short(size, 3)} kB, {short(frames_per_mbit(size), 2)}" for size in sizes_kb)
    return f"| {name} | {' | '.join(cells)} |"


def main() -> None:
    """Measure and print."""
    print(f"| frame | {' | '.join(f'quality {quality}' for quality in QUALITIES)} |")
    print("|---|" + "---|" * len(QUALITIES), flush=True)
    for name in sys.argv[1:] or SIZES:
        size = re.fullmatch(r"(\d+)x(\d+)", name)
        try:
            pictures = scene(int(size[1]), int(size[2])) if size else material(name)
        except (VisionError, ValueError) as error:
            sys.exit(str(error))
        height, width = pictures[0].shape[:2]
        shown = name if size else f"{Path(name).name}, {width}x{height}"
        print(row(shown, kilobytes(pictures)), flush=True)


if __name__ == "__main__":
    main()
