"""The detector ``learned``: boundaries by a small convolutional network, run by OpenCV.

``learned.onnx`` beside this module holds the network; ``benchmarks/quality/edges/train.py`` trains
and writes it. ``learned.md`` states where its training pictures come from and their terms.
"""

from __future__ import annotations

from collections import OrderedDict
from dataclasses import dataclass
from importlib.resources import as_file, files
from importlib.resources.abc import Traversable
from threading import Lock
from typing import ClassVar, Final

import cv2
import numpy as np
from numpy.typing import NDArray

from zv.edge.detectors.rendering import Picture, Strength
from zv.edge.detectors.ridges import RidgeDetector, half_size

MULTIPLE: Final = 16
"""The sides of the network's input are multiples of this: it halves the size four times."""

TARGET_PIXELS: Final = 45_000
"""Approximate number of pixels of the network's input, as far as ``FACTORS`` allow. It was trained
with 240 x 160 pixels; in larger pictures, boundaries are farther apart than in training, so a
reduced picture is as good and takes less time."""

FACTORS: Final = (0.25, 0.55)
"""Smallest and largest ratio of the input's sides to those of the picture."""

SIZES: Final = 2
"""Number of picture sizes whose buffers are kept, megabytes each."""

THRESHOLDS: Final = (1.0, 0.667, 0.499, 0.343, 0.228, 0.149, 0.095, 0.061, 0.038, 0.023, 0.013)
"""Measured by ``python -m benchmarks.quality edges --thresholds --detectors learned``."""


def network_size(height: int, width: int) -> tuple[int, int]:
    """Return the height and width to which a picture is resized for the network.

    They are multiples of 16, so that no padding is needed, which would add false boundaries.
    """
    least, most = FACTORS
    factor = min(most, max(least, (TARGET_PIXELS / (height * width)) ** 0.5))
    rows, columns = (round(side * factor / MULTIPLE) for side in (height, width))
    return max(rows, 1) * MULTIPLE, max(columns, 1) * MULTIPLE


def reduced(picture: Picture) -> Picture:
    """Return a picture resized to the network's size, (height, width, 3) uint8."""
    height, width = network_size(*picture.shape[:2])
    while picture.shape[1] > 2 * width:  # bilinear interpolation averages only two pixels a side
        picture = half_size(picture)
    smooth = cv2.GaussianBlur(picture, (3, 3), 0.5)
    return np.asarray(cv2.resize(smooth, (width, height), interpolation=cv2.INTER_LINEAR), np.uint8)


def network_planes(picture: Picture) -> NDArray[np.float32]:
    """Return the network's input for a picture: the channels of BGR and of CIE L*a*b*.

    Args:
        picture: (height, width, 3) uint8, BGR.

    Returns:
        (1, 6, height, width) float32, about -2 to 2.
    """
    lab = cv2.cvtColor(picture, cv2.COLOR_BGR2LAB)
    planes = np.empty((1, 6, *picture.shape[:2]), np.float32)
    for channel, values in enumerate((*cv2.split(picture), *cv2.split(lab))):
        np.subtract(values, np.float32(128), out=planes[0, channel])
    planes *= np.float32(1 / 64)
    return planes


class EdgeNetwork:
    """The network, loaded on first use; it is run by one thread at a time.

    A network of OpenCV has one input size, with buffers of that size. One network is kept for each
    of the last ``SIZES`` sizes.
    """

    def __init__(self, weights: Traversable) -> None:
        self._weights = weights
        self._lock = Lock()
        self._networks: OrderedDict[tuple[int, ...], cv2.dnn.Net] = OrderedDict()

    def probabilities(self, planes: NDArray[np.float32]) -> Strength:
        """Return the probability of a boundary at each pixel, (height, width) float32.

        Args:
            planes: (1, 6, height, width) float32; height and width are multiples of 16.
        """
        with self._lock:
            network = self._network_for(planes.shape)
            network.setInput(planes)
            logits = np.asarray(network.forward(), np.float32)
        height, width = planes.shape[2:]
        # Channel 2 y + x is the pixel (y, x) of a square of 2 x 2. A sigmoid in the network would
        # take seven times as long.
        squares = np.empty((height // 2, 2, width // 2, 2), np.float32)
        for row, pair in enumerate(logits.reshape(2, 2, height // 2, width // 2)):
            cv2.merge([*pair], squares[:, row])
        pixels = squares.reshape(height, width)
        cv2.exp(np.negative(pixels, out=pixels), dst=pixels)
        pixels += 1
        return np.reciprocal(pixels, out=pixels)

    def _network_for(self, shape: tuple[int, ...]) -> cv2.dnn.Net:
        network = self._networks.pop(shape, None)
        if network is None:
            # OpenCV 5.0 ignores the engine when it reads bytes, and uses the slower one.
            with as_file(self._weights) as path:
                network = cv2.dnn.readNetFromONNX(str(path), cv2.dnn.ENGINE_CLASSIC)
            if len(self._networks) == SIZES:
                self._networks.popitem(last=False)
        self._networks[shape] = network
        return network


@dataclass(frozen=True, slots=True)
class Learned(RidgeDetector):
    """Finds boundaries that people would draw, by a convolutional network of 370,000 weights.

    The strength is the network's estimate of the share of people that would draw a boundary at a
    pixel. It is too high, since boundaries had a larger weight in training. Lines are thinned
    along their ridges.
    """

    margin: ClassVar = 3
    smoothing: ClassVar = 0.25
    ridge_sigma: ClassVar = 1.5
    thresholds: ClassVar = THRESHOLDS
    network: ClassVar = EdgeNetwork(files("zv.edge.detectors") / "learned.onnx")
    """The only network of these weights in the process, shared by all detectors."""

    def strengths(self, picture: Picture) -> Strength:
        """Return the probabilities of a picture at a reduced size: float32, 0 to 1."""
        return self.network.probabilities(network_planes(self.seen(picture)))

    def seen(self, picture: Picture) -> Picture:
        """Return the picture at the network's size, BGR."""
        return reduced(picture)
