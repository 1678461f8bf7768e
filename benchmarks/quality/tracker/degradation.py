"""The clips as other cameras would have recorded them: tone, haze, noise, compression, shake, size.

No constant was fitted to these, so they say more of footage that nobody has tuned on than the clips
themselves. Each clip is seen at 10 Hz.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace

import cv2
import numpy as np

from benchmarks.quality.tracker.clips import Clip, Pixels, seen_otherwise
from benchmarks.quality.tracker.sequence import Box

SMALLER = 0.6
JPEG_QUALITY = 30
NOISE = 6.0
"""Standard deviation of the noise that is added to each value, grey levels."""

VEIL = 50
"""Grey levels that are added where the contrast is halved."""

SHAKE = 0.7
"""Standard deviation of a step of the camera, pixels; what is left of earlier ones is 0.7."""


def degraded(clip: Clip) -> Iterator[tuple[str, Clip]]:
    """Yield a clip at 10 Hz as it is and in each degradation, with what it is called."""
    slow = next(iter(seen_otherwise(clip)))
    yield "as it is", slow
    for name, change in CHANGES.items():
        yield name, replace(slow, pictures=change(slow.pictures))
    yield f"{SMALLER} of the size", _smaller(slow)


def _tone(gamma: float) -> Callable[[Pixels], Pixels]:
    table = np.rint(255 * (np.arange(256) / 255) ** gamma).astype(np.uint8)
    return lambda pictures: table[pictures]


def _hazy(pictures: Pixels) -> Pixels:
    return pictures // np.uint8(2) + np.uint8(VEIL)


def _noisy(pictures: Pixels) -> Pixels:
    random = np.random.default_rng(1)
    return np.stack(
        [
            np.clip(each + random.normal(0, NOISE, each.shape), 0, 255).astype(np.uint8)
            for each in pictures
        ]
    )


def _compressed(pictures: Pixels) -> Pixels:
    quality = (cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY)
    encoded = (cv2.imencode(".jpg", each, quality)[1] for each in pictures)
    return np.stack(
        [np.asarray(cv2.imdecode(each, cv2.IMREAD_COLOR), np.uint8) for each in encoded]
    )


def _shaken(pictures: Pixels) -> Pixels:
    random, offset, moved = np.random.default_rng(2), np.zeros(2), []
    for each in pictures:
        offset = 0.7 * offset + random.normal(0, SHAKE, 2)
        shift = np.array([[1, 0, offset[0]], [0, 1, offset[1]]])
        size = each.shape[1], each.shape[0]
        moved.append(cv2.warpAffine(each, shift, size, borderMode=cv2.BORDER_REPLICATE))
    return np.stack(moved).astype(np.uint8)


def _smaller(clip: Clip) -> Clip:
    height, width = clip.pictures.shape[1:3]
    small = round(SMALLER * width), round(SMALLER * height)
    ratio = small[0] / width

    def scaled(boxes: Mapping[int, Mapping[int, Box]]) -> dict[int, dict[int, Box]]:
        return {
            index: {
                identity: (ratio * x, ratio * y, ratio * wide, ratio * high)
                for identity, (x, y, wide, high) in found.items()
            }
            for index, found in boxes.items()
        }

    reduced = [cv2.resize(each, small, interpolation=cv2.INTER_AREA) for each in clip.pictures]
    return replace(
        clip,
        pictures=np.stack(reduced).astype(np.uint8),
        size=(round(ratio * clip.size[0]), round(ratio * clip.size[1])),
        truth=scaled(clip.truth),
        ignored=scaled(clip.ignored),
    )


CHANGES: dict[str, Callable[[Pixels], Pixels]] = {
    "brighter, gamma 0.6": _tone(0.6),
    "darker, gamma 1.6": _tone(1.6),
    "half of the contrast, as in haze": _hazy,
    f"noise of {NOISE:g} levels": _noisy,
    f"JPEG of quality {JPEG_QUALITY}": _compressed,
    "a camera that shakes by a pixel": _shaken,
}
