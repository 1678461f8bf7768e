"""Draws a frame with what was recorded of it and what is said of it now."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Final, TypeGuard

import cv2
import numpy as np
from numpy.typing import NDArray

from zenoh_vision.errors import PayloadError
from zenoh_vision.image import codecs, pixel_formats
from zenoh_vision.image.depth import RangeFinder
from zenoh_vision.image.files import decoded
from zenoh_vision.stream.frame_intake import snapshot_of
from zenoh_vision.stream.sample import Sample
from zv.bag.comparison import Difference, values_of
from zv.bag.record import Record

RECORDED: Final = (0, 200, 0)
NOW: Final = (255, 0, 255)
WHITE: Final = (255, 255, 255)
LINE: Final = 20
"""Height of a line of text, pixels."""
SMALLEST: Final = 640
MOST_CHARACTERS: Final = 110
FAR: Final = 1 << 20

Picture = NDArray[np.uint8]


def drawn(
    frame: Record, recorded: Sequence[Record], now: Sequence[Record], difference: Difference
) -> bytes:
    """Return a PNG: the frame with boxes and points of both, or both pictures beside each other."""
    panels = [_marked(_bgr(frame), recorded, now)]
    pictures = [
        [each for each in found if each.key == difference.key and _is_picture(each)]
        for found in (recorded, now)
    ]
    panels += [_bgr(found[0]) for found in pictures if found]
    height = max(each.shape[0] for each in panels)
    padded = [
        cv2.copyMakeBorder(each, 0, height - each.shape[0], 0, 8, cv2.BORDER_CONSTANT)
        for each in panels
    ]
    whole = np.asarray(cv2.hconcat(padded), np.uint8)
    wider = max(0, SMALLEST - whole.shape[1])
    whole = np.asarray(cv2.copyMakeBorder(whole, 4 * LINE, 0, 0, wider, cv2.BORDER_CONSTANT))
    seq = frame.header.get("seq")
    _write(whole, 0, f"frame {seq}: {difference.key} {difference.field}", WHITE)
    _write(whole, 1, f"recorded: {difference.recorded}", RECORDED)
    _write(whole, 2, f"now: {difference.now}", NOW)
    return codecs.encode_png(np.asarray(whole, np.uint8))


def _is_picture(record: Record) -> bool:
    return record.encoding.startswith("image/")


def _bgr(record: Record) -> Picture:
    """Return a picture as pixels, (height, width, 3) BGR; grey if it cannot be decoded."""
    try:
        if _is_picture(record) and record.key.count("/edges/"):
            found = decoded(record.payload)
            pixels = pixel_formats.convert(found.pixels, found.encoding, "bgr8")
            return np.array(pixels, np.uint8)
        sample = Sample(record.key, record.payload, record.encoding, record.attachment)
        frame = snapshot_of(sample)
        frame.find_range(RangeFinder())
        return np.array(frame.bgr, np.uint8)
    except (PayloadError, ValueError):
        return np.full((240, 320, 3), 128, np.uint8)


def _marked(bgr: Picture, recorded: Sequence[Record], now: Sequence[Record]) -> Picture:
    for found, colour, thick in ((recorded, RECORDED, 3), (now, NOW, 1)):
        for record in found:
            if _is_picture(record):
                continue
            for box, point in shapes_in(values_of(record)):
                if box is not None:
                    x, y, width, height = (int(np.clip(each, -FAR, FAR)) for each in box)
                    cv2.rectangle(bgr, (x, y), (x + width, y + height), colour, thick)
                if point is not None:
                    x, y = (int(np.clip(round(each), -FAR, FAR)) for each in point)
                    cv2.circle(bgr, (x, y), 2 * thick, colour, thick)
    return bgr


def shapes_in(fields: Any) -> Iterator[tuple[Sequence[float] | None, tuple[float, float] | None]]:
    """Yield the box and the point of each map in a message that has one of them."""
    if isinstance(fields, Mapping):
        box: Any = fields.get("box")
        x, y = fields.get("x"), fields.get("y")
        if not (isinstance(box, (list, tuple)) and len(box) == 4 and all(map(_is_number, box))):
            box = None
        point = (float(x), float(y)) if _is_number(x) and _is_number(y) else None
        if box is not None or point is not None:
            yield box, point
        for each in fields.values():
            yield from shapes_in(each)
    elif isinstance(fields, (list, tuple)):
        for each in fields:
            yield from shapes_in(each)


def _is_number(value: Any) -> TypeGuard[float]:
    return type(value) in (int, float) and math.isfinite(value)


def _write(picture: Picture, line: int, text: str, colour: tuple[int, int, int]) -> None:
    shown = text[:MOST_CHARACTERS].encode("ascii", "replace").decode()
    place = 6, (line + 1) * LINE - 4
    cv2.putText(picture, shown, place, cv2.FONT_HERSHEY_SIMPLEX, 0.45, colour, 1, cv2.LINE_AA)
