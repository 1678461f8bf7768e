"""The interface of pictures in the form in which a source stores them."""

from __future__ import annotations

import threading
from abc import ABC, abstractmethod
from typing import Any

import numpy as np
from numpy.typing import NDArray


class StoredPicture(ABC):
    """A picture in a source's own form; others are made on demand, each at most once.

    Safe to use from several threads.
    """

    def __init__(self) -> None:
        self._bgr: NDArray[np.uint8] | None = None
        self._lock = threading.Lock()

    @property
    @abstractmethod
    def size(self) -> tuple[int, int]:
        """Width and height, pixels."""

    def bgr(self) -> NDArray[np.uint8]:
        """Return the pixels, (height, width, 3); read-only."""
        with self._lock:
            if self._bgr is None:
                self._bgr = self._made_bgr()
                self._bgr.flags.writeable = False
            return self._bgr

    def copy_bgr(self, target: NDArray[np.uint8]) -> None:
        """Write the pixels to memory of their size, (height, width, 3).

        They are kept only if they cannot be written straight to it.
        """
        made = self._bgr
        if made is not None or not self._write_bgr(target):
            np.copyto(target, self.bgr() if made is None else made)

    @abstractmethod
    def jpeg(self, quality: int) -> bytes:
        """Return the picture as a JPEG of this quality, 1 to 100."""

    @abstractmethod
    def cropped(self, box: tuple[int, int, int, int]) -> StoredPicture | None:
        """Return the part in a rectangle (x, y, width, height); None if this form cannot have it.

        It cannot if the rectangle divides pixels that share values of chroma.
        """

    @abstractmethod
    def equals(self, other: StoredPicture) -> bool:
        """Tell whether another picture has the same values."""

    @abstractmethod
    def _made_bgr(self) -> NDArray[np.uint8]:
        """Return new pixels."""

    def _write_bgr(self, _target: NDArray[np.uint8], /) -> bool:
        """Write new pixels to memory of their size; return False if that is not possible."""
        return False


def are_equal(one: NDArray[Any], other: NDArray[Any]) -> bool:
    """Tell whether two arrays are equal; one row is nearly always enough to find a difference."""
    if one.shape != other.shape:
        return False
    row = one.shape[0] // 2
    return np.array_equal(one[row], other[row]) and np.array_equal(one, other)
