"""Sequences of pictures with their ground truth."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from zenoh_vision.image.codecs import decode_jpeg, encode_jpeg

Box = tuple[float, float, float, float]
"""x, y, width, height in pixels."""

START_NS = 1_700_000_000_000_000_000
VTEST_RATE_HZ = 10.0


@dataclass(frozen=True)
class Shot:
    """One picture and what is to be found in it.

    Attributes:
        index: Number of the picture in its sequence, from 0; frames left out keep their numbers.
        bgr: (height, width, 3) uint8.
        stamp_ns: Capture time.
        truth: Box of each object by its id.
        ignored: Boxes that may be found or not: objects that are mostly hidden or outside.
    """

    index: int
    bgr: NDArray[np.uint8]
    stamp_ns: int
    truth: dict[int, Box]
    ignored: list[Box] = field(default_factory=list)


Shots = Callable[[], Iterator[Shot]]
"""A sequence that can be iterated several times; it is drawn or decoded each time."""


def read_mot(path: Path, *, ignored: bool = False) -> dict[int, dict[int, Box]]:
    """Read a ground truth in MOT format: ``frame,id,left,top,width,height,flag,...``.

    Returns:
        Boxes by index of the picture and id. Frames count from 1 in the file, pictures from 0.
        Rows whose flag is 0 are left out, as the format wants; ``ignored`` returns these alone.

    Raises:
        ValueError: Naming file and line, if a row is not of this form or occurs twice.
    """
    found: dict[int, dict[int, Box]] = {}
    for number, line in enumerate(path.read_text().splitlines(), 1):
        if not line.strip():
            continue
        try:
            frame, identity, *box, flag = (float(word) for word in line.split(",")[:7])
            x, y, width, height = box
        except ValueError:
            raise ValueError(f"{path}, line {number}: not a row in MOT format: {line}") from None
        if bool(flag) == ignored:
            continue
        boxes = found.setdefault(int(frame) - 1, {})
        if int(identity) in boxes:
            raise ValueError(f"{path}, line {number}: id {identity:g} twice in frame {frame:g}")
        boxes[int(identity)] = (x, y, width, height)
    return found


def video(path: Path, truth: dict[int, dict[int, Box]], rate_hz: float = VTEST_RATE_HZ) -> Shots:
    """Return the pictures of a video up to the last one with truth."""

    def shots() -> Iterator[Shot]:
        opened = cv2.VideoCapture(str(path))
        for index in range(max(truth) + 1):
            read, bgr = opened.read()
            if not read:
                break
            stamp_ns = START_NS + round(index * 1e9 / rate_hz)
            yield Shot(index, np.asarray(bgr, np.uint8), stamp_ns, truth.get(index, {}))
        opened.release()

    return shots


def begun_at(shots: Shots, first: int) -> Shots:
    """Return a sequence without the pictures before ``first``."""
    return lambda: (shot for shot in shots() if shot.index >= first)


def every(shots: Shots, step: int, first: int = 0) -> Shots:
    """Return each ``step``-th picture of a sequence, from ``first`` on, which is below ``step``."""
    return lambda: (shot for shot in shots() if shot.index % step == first)


def dropped(shots: Shots, share: float, seed: int = 1) -> Shots:
    """Return a sequence without a random share of its pictures, the same ones each time."""

    def kept() -> Iterator[Shot]:
        rng = np.random.default_rng(seed)
        for shot in shots():
            if rng.random() >= share:
                yield shot

    return kept


def as_jpeg(shots: Shots, quality: int) -> Shots:
    """Return a sequence after JPEG encoding and decoding."""
    return lambda: (
        replace(shot, bgr=decode_jpeg(encode_jpeg(shot.bgr, "bgr8", quality), "bgr8"))
        for shot in shots()
    )
