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
    assert np.abs(picture.pixels.astype(int) - shown).max() <= 2
    assert np.abs(decoded(picture.jpeg(95)).astype(int) - shown).max() <= 4


def test_pixels_are_converted_straight_into_the_memory_of_a_frames_reader():
    picture = PackedPicture(scene())
    memory = np.full(48 * 64 * 3 + 8, 7, np.uint8)
    Frame(header(), picture).write(memory[:-8])
    assert picture._pixels is None, "converted to memory of its own, and copied"
    expected = cv2.cvtColor(scene(), cv2.COLOR_YUV2BGR_YUY2)
    assert np.array_equal(memory[:-8].reshape(48, 64, 3), expected)
    assert set(memory[-8:]) == {7}
    assert np.array_equal(picture.pixels, expected)


def test_pixels_that_exist_are_copied(monkeypatch: pytest.MonkeyPatch):
    picture, memory = PackedPicture(scene()), np.zeros(48 * 64 * 3, np.uint8)
    pixels = picture.pixels
    assert not pixels.flags.writeable
    monkeypatch.setattr(picture, "_make_pixels", lambda: pytest.fail("converted again"))
    picture.write(memory)
    assert np.array_equal(memory, pixels.ravel())
    assert picture.pixels is pixels


def test_memory_of_another_size_is_refused():
    with pytest.raises(ValueError, match="reshape"):
        PackedPicture(scene()).write(np.zeros(48 * 63 * 3, np.uint8))


@pytest.mark.parametrize(
    ("box", "is_packed"),
    [((2, 5, 20, 11), True), ((3, 5, 20, 11), False), ((2, 5, 21, 11), False)],
)
def test_a_part_of_whole_pairs_stays_as_it_is_and_no_other_part_can(
    box: tuple[int, int, int, int], is_packed: bool
):
    whole, (x, y, width, height) = PackedPicture(scene()), box
    part = whole.cropped(box)
    assert isinstance(part, PackedPicture) is is_packed
    assert np.array_equal(part.pixels, whole.pixels[y : y + height, x : x + width])


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
