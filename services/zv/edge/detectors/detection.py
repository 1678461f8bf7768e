"""``Detector`` and ``Detection``: the interface of all edge detectors.

A detector is a frozen dataclass: its fields are its parameters. It makes a ``Detection`` of one
picture, which computes the edge map, the strength and the stages only when each is asked for.
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
"""The steps that a detector may show, in their order."""

COLOURED: Final = frozenset({"direction"})
"""The steps whose pictures are (height, width, 3) in BGR order; the others are grey."""


class Detection(ABC):
    """What a detector finds in one picture; each part is computed when it is first asked for.

    Subclasses use ``functools.cached_property``. Two threads that ask at the same time may both
    compute a part; they get equal results.
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
        """The largest strength that is possible, whatever the picture; 65535 in 16 bits."""

    @abstractmethod
    def detect(self, picture: Picture) -> Detection:
        """Return what is found in a picture, which is not modified; nothing is computed yet."""
