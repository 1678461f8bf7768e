"""Every format from the driver to decoded pixels: vivid's bars say which colours are right."""

from __future__ import annotations

from contextlib import closing

import numpy as np
import pytest

from tests.support.cameras.drivers import writing
from tests.support.pictures.videos import jpeg_of, noise
from zv.camera.sources.base import DeviceWish
from zv.camera.sources.device import DeviceSource
from zv.camera.sources.v4l2.driver import Driver
from zv.camera.sources.v4l2.layouts import GREY, LAYOUTS, PREFERENCE
from zv.camera.sources.v4l2.offers import offers_of

WIDTH, HEIGHT = 640, 360
BARS = ((1, 1, 1), (0, 1, 1), (1, 1, 0), (0, 1, 0), (1, 0, 1), (0, 0, 1), (1, 0, 0), (0, 0, 0))
"""vivid's 75% bars from left to right, as parts of B, G, R: white, yellow, cyan, ... black."""
BRIGHT = 191
NOT_READ = {"YUVO", "YUVP", "Y444", "RGB1", "R444", "XR12", "AR12", "RX12", "RA12", "XB12"} | {
    *("AB12", "BX12", "GA12", "RX15", "RA15", "BX15", "BA15", "BGRH", "HSV3", "HSV4")
}
"""Formats of display hardware, HSV, and 4 bits a colour, whose white libav makes grey."""
NOT_OF_VIVID = {"MJPG", "JPEG", "Y14 ", "Z16 "}


def bars(fourcc: str, device: str = "/dev/video0") -> tuple[str, np.ndarray]:
    """Return the encoding of a picture in a format, and a pixel in the middle of each bar."""
    with closing(DeviceSource(device, DeviceWish(fourcc, WIDTH, HEIGHT))) as source:
        picture = source.read().picture
    assert picture.size == (WIDTH, HEIGHT)
    columns = [WIDTH // 16 + WIDTH // 8 * each for each in range(8)]
    return picture.encoding, picture.pixels[HEIGHT // 2, columns]


def test_vivid_offers_every_format_that_can_be_read_but_those_known_to_be_missing():
    driver = Driver("/dev/video0")
    offered = {offer.fourcc for offer in offers_of(driver)}
    driver.close()
    assert set(PREFERENCE) - offered == NOT_OF_VIVID
    assert offered - set(PREFERENCE) == NOT_READ


@pytest.mark.parametrize("fourcc", LAYOUTS)
def test_the_colours_of_a_format_are_right(fourcc: str):
    encoding, found = bars(fourcc)
    assert encoding == "bgr8"
    assert np.abs(found - np.array(BARS) * float(BRIGHT)).max() <= 5, found


@pytest.mark.parametrize(
    ("fourcc", "unit"),
    [("GREY", 1), ("Y10 ", 4), ("Y12 ", 16), ("Y16 ", 256), ("Y16B", 256)],
)
def test_grey_keeps_its_bits(fourcc: str, unit: int):
    encoding, found = bars(fourcc)
    assert encoding == ("mono8" if unit == 1 else "mono16")
    # vivid makes grey of colours by the weights of BT.709.
    luma = [BRIGHT * (0.0722 * b + 0.7152 * g + 0.2126 * r) for b, g, r in BARS]
    assert np.abs(found - np.array(luma) * unit).max() <= 3 * unit, found


@pytest.mark.parametrize("fourcc", ["YUYV", "NV12", "BGR3", "GREY"])
def test_a_device_with_the_interface_of_planes_is_read_too(fourcc: str):
    _, found = bars(fourcc, "/dev/video2")
    _, expected = bars(fourcc)
    assert np.array_equal(found, expected)


def test_jpegs_are_passed_on_undecoded():
    jpegs = [jpeg_of(noise(48, 64, 3) // each) for each in (1, 2)]
    with (
        writing(jpegs, "MJPG", (64, 48)),
        closing(DeviceSource("/dev/video10")) as source,
    ):
        assert "MJPG 64x48" in source.description
        for _ in range(3):
            picture = source.read().picture
            assert picture.form == "image/jpeg"
            assert picture.compressed(80) in jpegs


def test_every_grey_format_and_layout_is_tried_here():
    assert set(PREFERENCE) - NOT_OF_VIVID == {*LAYOUTS, *GREY} - NOT_OF_VIVID
