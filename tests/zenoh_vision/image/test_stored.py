"""What all pictures in a source's own form do with the pixels that are made of them."""

from __future__ import annotations

from collections import Counter

import numpy as np
from numpy.typing import NDArray

from tests.support.headers import header
from zenoh_vision.image.frame import Frame
from zenoh_vision.image.stored import StoredPicture, are_equal


class Plain(StoredPicture):
    """A picture whose pixels are 1 if they are made, and 2 if they are written to memory."""

    def __init__(self, *, writes: bool = True) -> None:
        super().__init__()
        self.counts: Counter[str] = Counter()
        self._writes = writes

    @property
    def size(self) -> tuple[int, int]:
        return 64, 48

    def jpeg(self, quality: int) -> bytes:
        raise NotImplementedError

    def cropped(self, box: tuple[int, int, int, int]) -> None:
        raise NotImplementedError

    def equals(self, other: StoredPicture) -> bool:
        raise NotImplementedError

    def _made_bgr(self) -> NDArray[np.uint8]:
        self.counts["made"] += 1
        return np.full((48, 64, 3), 1, np.uint8)

    def _write_bgr(self, target: NDArray[np.uint8], /) -> bool:
        self.counts["written"] += 1
        if self._writes:
            target[:] = 2
        return self._writes


def copied(picture: StoredPicture) -> set[int]:
    """Return the values in memory that a frame of the picture was copied to."""
    memory = np.zeros(48 * 64 * 3, np.uint8)
    Frame(header(), stored=picture).copy_raw(memory)
    return set(memory.tolist())


def test_pixels_are_written_to_memory_without_a_copy_unless_they_exist_already():
    picture = Plain()
    assert copied(picture) == {2}
    assert copied(picture) == {2}
    assert picture.bgr() is picture.bgr()
    assert copied(picture) == {1}
    assert picture.counts == {"written": 2, "made": 1}


def test_pixels_that_cannot_be_written_to_memory_are_made_and_copied():
    picture = Plain(writes=False)
    assert copied(picture) == {1}
    assert copied(picture) == {1}
    assert picture.counts == {"written": 1, "made": 1}


def test_arrays_are_equal_by_shape_and_all_values():
    one = np.zeros((5, 4), np.uint8)
    assert are_equal(one, one.copy())
    assert not are_equal(one, one[:4])
    for place in ((2, 3), (4, 0)):  # in the middle row, and in another
        other = one.copy()
        other[place] = 1
        assert not are_equal(one, other)
