"""``Detector`` and ``Detection``: the interface of all edge detectors.

A detector is a frozen dataclass whose fields are its parameters. Its ``detect`` returns a
``Detection`` of one picture, which computes edge map, strength and stages on demand.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from typing import ClassVar, Final, Literal

import numpy as np
from numpy.typing import NDArray

Gray = NDArray[np.uint8]
"""(height, width) uint8."""

Picture = NDArray[np.uint8]
"""(height, width) grey, or (height, width, 3) in BGR order."""

Strength = NDArray[np.float32]
"""(height, width) float32, at least 0."""

STAGES: Final = ("smoothed", "magnitude", "direction", "suppressed", "thresholded")
"""The names of a detector's steps, in order."""

COLOURED: Final = frozenset({"direction"})
"""The steps whose pictures are (height, width, 3) in BGR order; the others are grey."""


class Detection(ABC):
    """The result of a detector for one picture; each part is computed on first access.

    Subclasses use ``functools.cached_property``. Two threads that access a part at the same time
    may both compute it; they get equal results.
    """

    @property
    @abstractmethod
    def edges(self) -> Gray:
        """The edge map, (height, width) uint8: 255 on lines of one pixel's width, else 0."""

    @property
    @abstractmethod
    def strength(self) -> Strength:
        """The strength of each edge pixel after thinning and before any threshold, else 0.

        (height, width) float32, in the unit of the detector's thresholds.
        """

    @property
    @abstractmethod
    def stages(self) -> Mapping[str, Callable[[], Picture]]:
        """The steps by their names, all of ``STAGES``; each call computes one picture.

        Pictures are uint8: (height, width) grey, or (height, width, 3) in BGR order.
        """


class Detector(ABC):
    """Finds edges; a subclass is a frozen dataclass of its parameters.

    Attributes:
        wants: The form of the pictures that ``detect`` takes: ``gray`` (height, width) or ``bgr``
            (height, width, 3), uint8.
    """

    wants: ClassVar[Literal["gray", "bgr"]] = "gray"

    @property
    @abstractmethod
    def full_scale(self) -> float:
        """An upper bound of the strength in any picture; encoded as 65535 in 16 bits."""

    @abstractmethod
    def detect(self, picture: Picture) -> Detection:
        """Return the detection of a picture, which is not modified; nothing is computed yet."""
