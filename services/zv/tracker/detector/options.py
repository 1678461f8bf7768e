"""The choices of the settings of a model; imports nothing that loads slowly."""

from __future__ import annotations

import re
from typing import Final, Literal

LayoutName = Literal[
    "yolov5",
    "yolov8",
    "yolo_nms",
    "yolox",
    "nanodet",
    "rtdetr",
    "detr",
    "dfine",
    "ssd",
    "torchvision",
]
"""What the outputs of a model mean; ``layouts.LAYOUTS`` describes each."""

Fit = Literal["centre", "corner", "stretch"]
"""``centre``: scaled by one factor, with equal margins; ``corner``: the same, with the margins at
the right and below; ``stretch``: scaled to the input's width and height by two factors."""

Colours = Literal["rgb", "bgr"]

Values = Literal["0-1", "0-255", "signed", "imagenet"]
"""The range of the input's numbers: ``signed`` is -1 to 1, ``imagenet`` is less that data set's
mean, divided by its deviation, channel by channel."""

RuntimeName = Literal["auto", "onnxruntime", "opencv"]
Device = Literal["auto", "cpu", "cuda", "openvino", "coreml"]

MAX_THREADS: Final = 4
"""Threads of a model by default at most: other processes share the machine."""

CLASSES_FORM: Final = (
    "names separated by commas, each with a least score if wanted: person:0.6, car"
)


def classes_of(text: str) -> dict[str, float | None]:
    """Parse the setting ``classes``: ``person:0.6, car``.

    Raises:
        ValueError: Names the class and what is wrong with it.
    """
    found: dict[str, float | None] = {}
    for part in filter(None, map(str.strip, text.split(","))):
        name, colon, score = (word.strip() for word in part.rpartition(":"))
        if not colon:
            name, score = part, ""
        if not name:
            raise ValueError(f"{part!r}: a class must stand before ':'")
        if name in found:
            raise ValueError(f"{name!r}: the class is named twice")
        found[name] = _score(name, score) if colon else None
    return found


def _score(name: str, text: str) -> float:
    if not re.fullmatch(r"[0-9]*\.?[0-9]+", text) or float(text) > 1:
        raise ValueError(f"{name!r}: {text!r} is not a score; a score is from 0 to 1")
    return float(text)


def size_of(text: str) -> tuple[int, int]:
    """Parse width and height: ``640x480``.

    Raises:
        ValueError: It is not of this form.
    """
    found = re.fullmatch(r"([0-9]{1,4})x([0-9]{1,4})", text)
    if not found or "0" in (found[1], found[2]):
        raise ValueError(f"{text!r} is not a size; a size is WIDTHxHEIGHT")
    return int(found[1]), int(found[2])
