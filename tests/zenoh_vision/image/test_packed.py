"""Pictures of two bytes a pixel: their colours, their parts, and memory of any owner."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from tests.support.headers import header
from tests.support.pictures.videos import decoded
from zenoh_vision.image.frame import Frame
from zenoh_vision.image.packed import PackedPicture

COLOURS = {  # Y, U, V by ITU-R BT.601, in the limited range
    "black": ((16, 128, 128), (0, 0, 0)),
    "white": ((235, 128, 128), (255, 255, 255)),
    "red": ((81, 90, 240), (0, 0, 255)),
    "green": ((145, 54, 34), (0, 255, 0)),
    "blue": ((41, 240, 110), (255, 0, 0)),
}


def plain(width: int, height: int, colour: tuple[int, int, int]) -> np.ndarray:
    luma, blue, red = colour
    return np.tile(np.array([[luma, blue], [luma, red]], np.uint8), (height, width // 2, 1))


def scene() -> np.ndarray:
    """Return pairs of pixels of all values."""
    return np.random.default_rng(1).integers(0, 256, (48, 64, 2), np.uint8)


@pytest.mark.parametrize("name", COLOURS)
def test_the_colours_are_those_of_bt_601(name: str):
    stored, shown = COLOURS[name]
    picture = PackedPicture(plain(64, 48, stored))
    assert picture.size == (64, 48)
    assert np.abs(picture.bgr().astype(int) - shown).max() <= 2
    assert np.abs(decoded(picture.jpeg(95)).astype(int) - shown).max() <= 4


def test_pixels_are_converted_straight_into_the_memory_of_a_frames_reader():
    picture = PackedPicture(scene())
    memory = np.full(48 * 64 * 3 + 8, 7, np.uint8)
    Frame(header(), stored=picture).copy_raw(memory[:-8])
    assert picture._bgr is None, "converted to memory of its own, and copied"
    expected = cv2.cvtColor(scene(), cv2.COLOR_YUV2BGR_YUY2)
    assert np.array_equal(memory[:-8].reshape(48, 64, 3), expected)
    assert set(memory[-8:]) == {7}


def test_pixels_that_exist_are_copied():
    picture = PackedPicture(scene())
    pixels = picture.bgr()
    memory = np.zeros((48, 64, 3), np.uint8)
    picture.copy_bgr(memory)
    assert np.array_equal(memory, pixels)
    assert picture.bgr() is pixels


def test_pixels_that_several_may_use_cannot_be_written_to():
    assert not PackedPicture(scene()).bgr().flags.writeable


def test_memory_with_gaps_gets_the_pixels_too():
    memory = np.zeros((48, 64, 4), np.uint8)
    PackedPicture(scene()).copy_bgr(memory[:, :, :3])
    assert np.array_equal(memory[:, :, :3], PackedPicture(scene()).bgr())
    assert not memory[:, :, 3].any()


@pytest.mark.parametrize(
    "memory", [np.zeros((48, 63, 3), np.uint8), np.zeros((48, 64, 3), np.uint16)]
)
def test_memory_of_another_size_is_refused(memory: np.ndarray):
    with pytest.raises(ValueError, match="no memory for"):
        PackedPicture(scene()).copy_bgr(memory)


def test_a_part_of_whole_pairs_stays_as_it_is_and_no_other_part_can():
    whole = PackedPicture(scene())
    part = whole.cropped((2, 5, 20, 11))
    assert part is not None
    assert np.array_equal(part.bgr(), whole.bgr()[5:16, 2:22])
    assert whole.cropped((3, 5, 20, 11)) is None
    assert whole.cropped((2, 5, 21, 11)) is None


def test_pictures_are_equal_by_all_of_their_values():
    changed = scene()
    changed[47, 63, 1] ^= 1
    one = PackedPicture(scene())
    assert one.equals(PackedPicture(scene()))
    assert not one.equals(PackedPicture(changed))
    assert not one.equals(PackedPicture(scene()[:-1]))


@pytest.mark.parametrize(
    "image",
    [
        scene()[:, :-1].copy(),
        scene()[:, ::2],
        scene()[:, :, 0],
        scene().astype(np.uint16),
        np.zeros((48, 64, 3), np.uint8),
    ],
    ids=["an odd width", "gaps", "grey", "16 bits", "three bytes"],
)
def test_other_arrays_are_refused(image: np.ndarray):
    with pytest.raises(ValueError, match="is no YUYV"):
        PackedPicture(image)
