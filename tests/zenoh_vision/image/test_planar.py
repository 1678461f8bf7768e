"""Planes of a decoded video become a JPEG of the same colours as the pixels do."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.support.headers import header
from zenoh_vision.image import codecs
from zenoh_vision.image.frame import Frame
from zenoh_vision.image.planar import PlanarPicture, Planes

GREEN = (145, 54, 34)  # of BT.601 in limited range: B, G, R = 0, 255, 0


def plain(width: int, height: int, colour: tuple[int, int, int]) -> Planes:
    half = (height // 2, width // 2)
    luma, blue, red = (
        np.full(shape, value, np.uint8)
        for shape, value in zip(((height, width), half, half), colour, strict=True)
    )
    return luma, blue, red


def never() -> NDArray[np.uint8]:
    raise AssertionError("pixels were made")


@pytest.mark.parametrize("size", [(64, 48), (62, 46), (18, 10), (2, 2)])
@pytest.mark.parametrize(
    ("colour", "full_range", "bgr"),
    [
        (GREEN, False, (0, 255, 0)),
        ((16, 128, 128), False, (0, 0, 0)),
        ((235, 128, 128), False, (255, 255, 255)),
        ((0, 128, 128), True, (0, 0, 0)),
        ((255, 128, 128), True, (255, 255, 255)),
        ((76, 85, 255), True, (0, 0, 254)),  # red, by JFIF's equations
    ],
)
def test_a_jpeg_of_planes_has_their_colours(
    size: tuple[int, int],
    colour: tuple[int, int, int],
    full_range: bool,
    bgr: tuple[int, int, int],
):
    planar = PlanarPicture(plain(*size, colour), full_range=full_range, to_bgr=never)
    found = codecs.decode_jpeg(planar.jpeg(95), "bgr8")
    assert found.shape == (size[1], size[0], 3)
    assert np.abs(found.astype(int) - bgr).max() <= 3


@pytest.mark.parametrize("size", [(64, 47), (63, 48)])
def test_planes_with_an_odd_side_are_refused(size: tuple[int, int]):
    with pytest.raises(ValueError, match="must be even"):
        PlanarPicture(plain(*size, GREEN), full_range=False, to_bgr=never)


def test_what_is_darker_than_black_or_lighter_than_white_is_clipped():
    for luma, grey in ((0, 0), (15, 0), (236, 255), (255, 255)):
        planar = PlanarPicture(plain(16, 16, (luma, 128, 128)), full_range=False, to_bgr=never)
        assert np.abs(codecs.decode_jpeg(planar.jpeg(95), "mono8").astype(int) - grey).max() <= 1


def test_the_planes_are_not_changed():
    planes = plain(16, 16, GREEN)
    for plane in planes:
        plane.flags.writeable = False
    PlanarPicture(planes, full_range=False, to_bgr=never).jpeg(80)
    assert [int(plane[0, 0]) for plane in planes] == list(GREEN)


def counted(counts: Counter[str]) -> PlanarPicture:
    """Return plain green planes whose pixels are of another green, so that both can be told."""

    def to_bgr() -> NDArray[np.uint8]:
        counts["bgr"] += 1
        return np.full((48, 64, 3), (10, 200, 30), np.uint8)

    return PlanarPicture(plain(64, 48, GREEN), full_range=False, to_bgr=to_bgr)


def test_a_frame_of_planes_makes_pixels_only_if_they_are_asked_for_and_once():
    counts: Counter[str] = Counter()
    made = Frame(header(), counted(counts))
    assert made.compressed.startswith(codecs.JPEG_START)
    assert not counts
    assert made.bgr[0, 0].tolist() == [10, 200, 30]
    assert (made.pixels is made.bgr, made.raw[:3]) == (True, bytes([10, 200, 30]))
    memory = np.zeros(48 * 64 * 3, np.uint8)
    made.write(memory)
    assert memory[:3].tolist() == [10, 200, 30]
    assert made.gray.shape == (48, 64)
    assert made.reduced("bgr8", 8, 8).shape == (48, 64, 3)
    assert counts == {"bgr": 1}


@pytest.mark.parametrize("box", [(2, 4, 20, 10), (3, 4, 20, 10), (2, 4, 20, 11)])
def test_a_part_stays_planes_if_all_its_numbers_are_even(box: tuple[int, int, int, int]):
    part = counted(Counter()).cropped(box)
    assert isinstance(part, PlanarPicture) is not any(number % 2 for number in box)
    assert part.size == box[2:]
    assert part.pixels[0, 0].tolist() == [10, 200, 30]


def test_equal_planes_are_equal_pictures():
    one, same = (PlanarPicture(plain(8, 8, GREEN), full_range=False, to_bgr=never) for _ in "ab")
    planes = plain(8, 8, GREEN)
    planes[2][0, 0] += 1
    other = PlanarPicture(planes, full_range=False, to_bgr=never)
    smaller = PlanarPicture(plain(8, 6, GREEN), full_range=False, to_bgr=never)
    assert one.equals(same)
    assert not one.equals(other)
    assert not one.equals(smaller)
