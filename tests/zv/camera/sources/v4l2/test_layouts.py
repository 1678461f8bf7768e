"""Pictures of a driver's buffers, with buffers written by hand after the kernel's documentation."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from zenoh_vision.errors import PayloadError
from zv.camera.sources.libav_frames import FrameConverter
from zv.camera.sources.v4l2.driver import Granted, code_of, fourcc_of
from zv.camera.sources.v4l2.layouts import GREY, JPEG, LAYOUTS, PREFERENCE, raw_picture

WIDTH, HEIGHT, PADDING = 32, 16, 24
# Y, U, V of BT.601 in the limited range, and B, G, R: the left half is red, the right one blue.
RED_YUV, BLUE_YUV = (81, 90, 240), (41, 240, 110)
RED, BLUE = (0, 0, 255), (255, 0, 0)
HALVES = ((WIDTH // 4, RED), (3 * WIDTH // 4, BLUE))


def plane(left: object, right: object, columns: int, rows: int, padding: int = 0) -> np.ndarray:
    """Return rows of bytes, with padding behind each; each half repeats one group of bytes."""
    groups = [np.atleast_1d(np.array(each, np.uint8)) for each in (left, right)]
    row = np.concatenate([np.tile(each, columns // 2) for each in groups])
    padded = np.concatenate([row, np.full(padding, 7, np.uint8)])
    return np.tile(padded, (rows, 1)).ravel()


def packed(order: str) -> np.ndarray:
    """Return a picture of two bytes a pixel, such as ``YUYV``."""
    left, right = (
        [{"Y": y, "U": u, "V": v}[letter] for letter in order] for y, u, v in (RED_YUV, BLUE_YUV)
    )
    return plane(left, right, WIDTH // 2, HEIGHT, PADDING)


def planes(order: str, width: int, height: int, *, together: bool = False) -> np.ndarray:
    """Return luma, and chroma of a size: in two planes, or in one of pairs."""
    luma = plane(RED_YUV[0], BLUE_YUV[0], WIDTH, HEIGHT, PADDING)
    chroma = {"U": (RED_YUV[1], BLUE_YUV[1]), "V": (RED_YUV[2], BLUE_YUV[2])}
    stride = (WIDTH + PADDING) * width // WIDTH
    if together:
        left, right = ([chroma[each][half] for each in order] for half in (0, 1))
        return np.concatenate([luma, plane(left, right, width, height, 2 * stride - 2 * width)])
    parts = [plane(*chroma[each], width, height, stride - width) for each in order]
    return np.concatenate([luma, *parts])


def pixels(red: list[int], blue: list[int]) -> np.ndarray:
    return plane(red, blue, WIDTH, HEIGHT, PADDING)


BAYER = {"BA81": "BGGR", "GBRG": "GBRG", "GRBG": "GRBG", "RGGB": "RGGB"}
DEEP_BAYER = {
    10: {"BG10": "BGGR", "GB10": "GBRG", "BA10": "GRBG", "RG10": "RGGB"},
    12: {"BG12": "BGGR", "GB12": "GBRG", "BA12": "GRBG", "RG12": "RGGB"},
    16: {"BYR2": "BGGR", "GB16": "GBRG", "GR16": "GRBG", "RG16": "RGGB"},
}


def mosaic(order: str, bits: int = 8) -> np.ndarray:
    """Return a picture that is red on the left and blue on the right, one colour a pixel."""
    found = np.zeros((HEIGHT, WIDTH + PADDING), np.uint8 if bits == 8 else "<u2")
    bright = 2**bits - 1
    for index, letter in enumerate(order):
        row, column = divmod(index, 2)
        part = found[row::2, column:WIDTH:2]
        part[:, : WIDTH // 4] = bright * (letter == "R")
        part[:, WIDTH // 4 :] = bright * (letter == "B")
    return found.ravel().view(np.uint8)


def four(order: str) -> np.ndarray:
    """Return a picture of four bytes a pixel, such as ``AYUV``."""
    red, blue = (dict(zip("YUV", each, strict=True)) for each in (RED_YUV, BLUE_YUV))
    return pixels([red.get(each, 9) for each in order], [blue.get(each, 9) for each in order])


HALF_W, HALF_H = WIDTH // 2, HEIGHT // 2
BUFFERS = {
    "YUYV": packed("YUYV"),
    "UYVY": packed("UYVY"),
    "YVYU": packed("YVYU"),
    "VYUY": packed("VYUY"),
    "NV12": planes("UV", HALF_W, HALF_H, together=True),
    "NV21": planes("VU", HALF_W, HALF_H, together=True),
    "NV16": planes("UV", HALF_W, HEIGHT, together=True),
    "NV61": planes("VU", HALF_W, HEIGHT, together=True),
    "NV24": planes("UV", WIDTH, HEIGHT, together=True),
    "NV42": planes("VU", WIDTH, HEIGHT, together=True),
    "YU12": planes("UV", HALF_W, HALF_H),
    "YV12": planes("VU", HALF_W, HALF_H),
    "422P": planes("UV", HALF_W, HEIGHT),
    **{each: four(each) for each in ("VUYA", "VUYX", "AYUV", "XYUV", "YUVA", "YUVX")},
    "YUV4": four("AYUV"),
    "RGB3": pixels([255, 0, 0], [0, 0, 255]),
    "BGR3": pixels([0, 0, 255], [255, 0, 0]),
    "XR24": pixels([0, 0, 255, 9], [255, 0, 0, 9]),
    "AR24": pixels([0, 0, 255, 9], [255, 0, 0, 9]),
    "BGR4": pixels([0, 0, 255, 9], [255, 0, 0, 9]),
    "BX24": pixels([9, 255, 0, 0], [9, 0, 0, 255]),
    "BA24": pixels([9, 255, 0, 0], [9, 0, 0, 255]),
    "RGB4": pixels([9, 255, 0, 0], [9, 0, 0, 255]),
    "XB24": pixels([255, 0, 0, 9], [0, 0, 255, 9]),
    "AB24": pixels([255, 0, 0, 9], [0, 0, 255, 9]),
    "RX24": pixels([9, 0, 0, 255], [9, 255, 0, 0]),
    "RA24": pixels([9, 0, 0, 255], [9, 255, 0, 0]),
    "RGBP": pixels([0x00, 0xF8], [0x1F, 0x00]),
    "RGBO": pixels([0x00, 0x7C], [0x1F, 0x00]),
    "XR15": pixels([0x00, 0x7C], [0x1F, 0x00]),
    "AR15": pixels([0x00, 0x7C], [0x1F, 0x00]),
    "XB15": pixels([0x1F, 0x00], [0x00, 0x7C]),
    "AB15": pixels([0x1F, 0x00], [0x00, 0x7C]),
    "RGBR": pixels([0xF8, 0x00], [0x00, 0x1F]),
    "RGBQ": pixels([0x7C, 0x00], [0x00, 0x1F]),
    **{fourcc: mosaic(order) for fourcc, order in BAYER.items()},
    **{
        fourcc: mosaic(order, bits)
        for bits, fourccs in DEEP_BAYER.items()
        for fourcc, order in fourccs.items()
    },
}


def stride_of(fourcc: str) -> int:
    if fourcc in {"NV12", "NV21", "NV16", "NV61", "NV24", "NV42", "YU12", "YV12", "422P", *BAYER}:
        return WIDTH + PADDING
    return BUFFERS[fourcc].size // HEIGHT


def form(fourcc: str, stride: int, *, bt709: bool = False, full: bool = False) -> Granted:
    return Granted(fourcc, WIDTH, HEIGHT, stride, bt709, full)


@pytest.mark.parametrize("fourcc", LAYOUTS)
def test_the_colours_of_each_format_are_right(fourcc: str):
    picture = raw_picture(BUFFERS[fourcc], form(fourcc, stride_of(fourcc)), FrameConverter())
    assert (picture.encoding, picture.size) == ("bgr8", (WIDTH, HEIGHT))
    for column, colour in HALVES:
        assert np.allclose(picture.pixels[HEIGHT // 2, column], colour, atol=8)
    shown = cv2.imdecode(np.frombuffer(picture.jpeg(95), np.uint8), cv2.IMREAD_COLOR)
    for column, colour in HALVES:
        assert np.allclose(shown[HEIGHT // 2, column], colour, atol=12)


@pytest.mark.parametrize(
    ("fourcc", "first", "last"),
    [
        ("GREY", b"\x05", b"\xfa"),
        ("Y10 ", b"\x05\x00", b"\xff\x03"),
        ("Y12 ", b"\x05\x00", b"\xff\x0f"),
        ("Y14 ", b"\x05\x00", b"\xff\x3f"),
        ("Y16 ", b"\x05\x00", b"\xfe\xff"),
        ("Y16B", b"\x00\x05", b"\xff\xfe"),
        ("Z16 ", b"\x05\x00", b"\xfe\xff"),
    ],
)
def test_grey_keeps_its_bits(fourcc: str, first: bytes, last: bytes):
    buffer = plane(list(first), list(last), WIDTH, HEIGHT, PADDING)
    picture = raw_picture(buffer, form(fourcc, buffer.size // HEIGHT), FrameConverter())
    order = "big" if fourcc == "Y16B" else "little"
    assert picture.encoding == ("mono8" if fourcc == "GREY" else "mono16")
    assert picture.pixels[3, 0] == 5
    assert picture.pixels[3, -1] == int.from_bytes(last, order)


@pytest.mark.parametrize("fourcc", ["YUYV", "NV12"])
def test_the_colour_space_and_range_that_the_driver_states_are_heeded(fourcc: str):
    def red(**space: bool) -> list[int]:
        stated = form(fourcc, stride_of(fourcc), **space)
        return raw_picture(BUFFERS[fourcc], stated, FrameConverter()).pixels[4, 4].tolist()

    # By hand, BT.709 in the limited range: R = 1.164 (81 - 16) + 1.793 (240 - 128) = 277,
    # G = 75.7 - 0.213 (90 - 128) - 0.533 (240 - 128) = 24, B = 75.7 + 2.112 (90 - 128) = -5.
    assert np.allclose(red(bt709=True), [0, 24, 255], atol=3)
    # BT.601 in the full range: R = 81 + 1.402 * 112 = 238, G = 81 + 13 - 80 = 14, B = 14.
    assert np.allclose(red(full=True), [14, 14, 238], atol=3)


@pytest.mark.parametrize("fourcc", ["YUYV", "NV12", "YU12", "GREY", "RGB3"])
def test_a_buffer_that_is_cut_short_is_refused(fourcc: str):
    buffer = BUFFERS.get(fourcc, plane(1, 2, WIDTH, HEIGHT))
    stride = stride_of(fourcc) if fourcc in BUFFERS else WIDTH
    with pytest.raises(PayloadError, match="wrong_size"):
        raw_picture(buffer[: buffer.size // 2], form(fourcc, stride), FrameConverter())


def test_a_picture_keeps_its_pixels_when_the_driver_fills_the_buffer_again():
    for fourcc in ("YUYV", "NV12", "RGB3"):
        buffer = BUFFERS[fourcc].copy()
        picture = raw_picture(buffer, form(fourcc, stride_of(fourcc)), FrameConverter())
        buffer[:] = 0
        assert np.allclose(picture.pixels[4, 4], RED, atol=8)


def test_every_format_that_can_be_read_has_a_place_in_the_order_and_no_other():
    assert sorted(PREFERENCE) == sorted({*JPEG, *GREY, *LAYOUTS})


@pytest.mark.parametrize("fourcc", PREFERENCE)
def test_a_format_has_the_kernels_number(fourcc: str):
    assert fourcc_of(code_of(fourcc)) == fourcc


def test_the_numbers_are_those_of_the_kernels_header():
    assert code_of("YUYV") == 0x56595559
    assert code_of("Y16B") == 0xA0363159  # V4L2_PIX_FMT_Y16_BE: v4l2_fourcc_be('Y', '1', '6', ' ')
