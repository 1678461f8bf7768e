"""The detector ``learned``: boundaries as a small network finds them, run by OpenCV.

``learned.onnx`` beside this module holds the network; ``benchmarks/quality/edges/train.py`` trains
and writes it. ``learned.md`` states where its training pictures come from and their terms.
"""

from __future__ import annotations

from collections import OrderedDict
from dataclasses import dataclass
from importlib.resources import files
from threading import Lock
from typing import ClassVar, Final

import cv2
import numpy as np
from numpy.typing import NDArray

from zv.edge.detectors.detection import Picture, Strength
from zv.edge.detectors.ridges import RidgeDetector, half_size

MULTIPLE: Final = 16
"""The network halves the size four times."""

MOST_PIXELS: Final = 256 * 192
"""Pixels that the network gets, where half to a quarter of the picture's width and height gives so
many. It was trained with 240 x 160 pixels; boundaries of a larger picture are farther apart in
pixels than it knows, so a reduced picture is better and takes less time."""

SIZES: Final = 2
"""Numbers of picture sizes whose buffers are kept, megabytes each."""


@dataclass(frozen=True, slots=True)
class Learned(RidgeDetector):
    """Boundaries that people would draw, by a convolutional network of 163,000 weights.

    The strength is the network's estimate of the share of people that would draw a boundary here,
    with boundaries weighted up by its training; lines are thinned along their ridges.
    """

    thresholds: ClassVar = (1.0, 0.615, 0.446, 0.3, 0.193, 0.122, 0.076, 0.045, 0.025, 0.013, 0.005)

    def strengths(self, picture: Picture) -> Strength:
        """Return the probabilities of a picture at a reduced size: float32, 0 to 1."""
        small = reduced(half_size(picture))
        height, width = small.shape[:2]
        down, right = -height % MULTIPLE, -width % MULTIPLE
        padded = cv2.copyMakeBorder(small, 0, down, 0, right, cv2.BORDER_REPLICATE)
        return NETWORK.probabilities(network_planes(np.asarray(padded, np.uint8)))[:height, :width]


def reduced(half: Picture) -> Picture:
    """Return a picture at half its size as it is, or with fewer pixels, down to a quarter."""
    height, width = half.shape[:2]
    factor = min(1.0, max(0.5, (MOST_PIXELS / (height * width)) ** 0.5))
    if factor == 1:
        return half
    size = round(width * factor), round(height * factor)
    return np.asarray(cv2.resize(half, size, interpolation=cv2.INTER_LINEAR), np.uint8)


def network_planes(picture: Picture) -> NDArray[np.float32]:
    """Return what the network takes of a picture: its channels and those of CIE L*a*b*.

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
    """The network, read when it is first used; one thread at a time runs it.

    OpenCV's networks are bound to one input size, and keep their buffers: one is kept for each of
    the ``SIZES`` sizes that were used last.
    """

    def __init__(self) -> None:
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
            squares = np.asarray(network.forward())
        height, width = planes.shape[2:]
        # Channel 2 y + x is the pixel (y, x) of a square of 2 x 2.
        pixels = squares.reshape(2, 2, height // 2, width // 2).transpose(2, 0, 3, 1)
        return np.asarray(pixels.reshape(height, width), np.float32)

    def _network_for(self, shape: tuple[int, ...]) -> cv2.dnn.Net:
        network = self._networks.pop(shape, None)
        if network is None:
            onnx = (files("zv.edge.detectors") / "learned.onnx").read_bytes()
            network = cv2.dnn.readNetFromONNX(np.frombuffer(onnx, np.uint8), cv2.dnn.ENGINE_CLASSIC)
            if len(self._networks) == SIZES:
                self._networks.popitem(last=False)
        self._networks[shape] = network
        return network


NETWORK: Final = EdgeNetwork()
"""The process's one network."""
