"""How each pixel format stores a picture, and which formats are cheapest to handle."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from typing import Any, Final

import numpy as np
from av.video.frame import VideoFrame
from av.video.reformatter import ColorRange
from numpy.typing import NDArray

from zenoh_vision.errors import PayloadError
from zenoh_vision.image.packed import PackedPicture
from zenoh_vision.image.picture import Picture, PixelPicture
from zv.camera.sources.libav_frames import FrameConverter
from zv.camera.sources.v4l2.driver import Granted

BT_709: Final = 1
BT_601: Final = 6
"""As libav numbers them."""

JPEG: Final = ("MJPG", "JPEG")
"""Formats whose pictures are passed on undecoded."""

GREY: Final = {"GREY": "u1", "Y10 ": "<u2", "Y12 ": "<u2", "Y14 ": "<u2", "Y16 ": "<u2"} | {
    "Y16B": ">u2",
    "Z16 ": "<u2",
}
"""Type of the pixels of grey formats; those of 16 bits keep their values, 0 to 1023 of ``Y10``."""

HALF: Final = Fraction(1, 2)
SWAPPED: Final = (1, 0, 3, 2)
"""Two bytes exchanged: libav shows wrong colours for its own formats with the high byte first."""


@dataclass(frozen=True, slots=True)
class Layout:
    """How libav stores a format.

    Attributes:
        name: libav's name of the format.
        planes: Of each plane in the driver's order: its number in libav, its bytes in a row as a
            share of those of the first plane, its rows as a share of the picture's.
        interleaved: Whether the second plane of the driver has the samples of libav's second and
            third plane in turn.
        order: Of each four bytes that libav stores, their places in the driver's four; empty if
            they are the same.
        bits: Of each 16 that the driver stores, how many it uses: the lowest.
    """

    name: str
    planes: tuple[tuple[int, Fraction, Fraction], ...] = ((0, Fraction(1), Fraction(1)),)
    interleaved: bool = False
    order: tuple[int, ...] = ()
    bits: int = 16


def _three(name: str, order: tuple[int, int], rows: Fraction) -> Layout:
    one = Fraction(1)
    first, second = order
    return Layout(name, ((0, one, one), (first, HALF, rows), (second, HALF, rows)))


def _two(name: str, share: Fraction, rows: Fraction) -> Layout:
    return Layout(name, ((0, Fraction(1), Fraction(1)), (1, share, rows)))


def _turns(order: tuple[int, int], name: str = "yuv420p", rows: Fraction = HALF) -> Layout:
    one = Fraction(1)
    return Layout(name, ((0, one, one), (order[0], one, rows), (order[1], one, rows)), True)


LAYOUTS: Final = {
    "YUYV": Layout("yuyv422"),
    "UYVY": Layout("uyvy422"),
    "YVYU": Layout("yvyu422"),
    "VYUY": Layout("uyvy422", order=(2, 1, 0, 3)),
    "NV12": _turns((1, 2)),
    "NV21": _turns((2, 1)),
    "NV16": _two("nv16", Fraction(1), Fraction(1)),
    "NV61": _turns((2, 1), "yuv422p", Fraction(1)),
    "NV24": _two("nv24", Fraction(2), Fraction(1)),
    "NV42": _two("nv42", Fraction(2), Fraction(1)),
    "YU12": _three("yuv420p", (1, 2), HALF),
    "YV12": _three("yuv420p", (2, 1), HALF),
    "422P": _three("yuv422p", (1, 2), Fraction(1)),
    "VUYA": Layout("vuyx"),
    "VUYX": Layout("vuyx"),
    **dict.fromkeys(("AYUV", "XYUV", "YUV4"), Layout("vuyx", order=(3, 2, 1, 0))),
    **dict.fromkeys(("YUVA", "YUVX"), Layout("vuyx", order=(2, 1, 0, 3))),
    "RGB3": Layout("rgb24"),
    "BGR3": Layout("bgr24"),
    "XR24": Layout("bgr0"),
    "AR24": Layout("bgr0"),
    "BGR4": Layout("bgr0"),
    "BX24": Layout("0rgb"),
    "BA24": Layout("0rgb"),
    "RGB4": Layout("0rgb"),
    "XB24": Layout("rgb0"),
    "AB24": Layout("rgb0"),
    "RX24": Layout("0bgr"),
    "RA24": Layout("0bgr"),
    "RGBP": Layout("rgb565le"),
    "RGBO": Layout("rgb555le"),
    "XR15": Layout("rgb555le"),
    "AR15": Layout("rgb555le"),
    "XB15": Layout("bgr555le"),
    "AB15": Layout("bgr555le"),
    "RGBR": Layout("rgb565le", order=SWAPPED),
    "RGBQ": Layout("rgb555le", order=SWAPPED),
    "BA81": Layout("bayer_bggr8"),
    "GBRG": Layout("bayer_gbrg8"),
    "GRBG": Layout("bayer_grbg8"),
    "RGGB": Layout("bayer_rggb8"),
    **{
        fourcc: Layout(f"bayer_{pattern}16le", bits=bits)
        for pattern, *fourccs in (
            ("bggr", "BG10", "BG12", "BYR2"),
            ("gbrg", "GB10", "GB12", "GB16"),
            ("grbg", "BA10", "BA12", "GR16"),
            ("rggb", "RG10", "RG12", "RG16"),
        )
        for fourcc, bits in zip(fourccs, (10, 12, 16), strict=True)
    },
}
"""How libav stores each format that is neither JPEG nor grey. Alpha, which cameras set to anything,
is ignored."""

PREFERENCE: Final = (
    *JPEG,
    *("YUYV", "NV12", "NV21", "YU12", "YV12", "UYVY", "YVYU", "VYUY", "422P", "NV16", "NV61"),
    *("NV24", "NV42", "VUYA", "VUYX", "AYUV", "XYUV", "YUV4", "YUVA", "YUVX"),
    *("BGR3", "RGB3", "XR24", "AR24", "BGR4", "BX24", "BA24", "RGB4", "XB24", "AB24", "RX24"),
    *("RA24", "RGBP", "RGBR", "RGBO", "RGBQ", "XR15", "AR15", "XB15", "AB15"),
    *("GREY", "Y16 ", "Y16B", "Y14 ", "Y12 ", "Y10 ", "Z16 "),
    *("BA81", "GBRG", "GRBG", "RGGB", "BYR2", "GB16", "GR16", "RG16"),
    *("BG12", "GB12", "BA12", "RG12", "BG10", "GB10", "BA10", "RG10"),
)
"""The formats that can be read, the cheapest to handle first: JPEGs are passed on; YUYV and 4:2:0
become pixels or a JPEG only for who wants them; the others are converted when they arrive. Grey
comes late, since a camera that has colours too is expected to show them."""


def preference(fourcc: str, *, deep: bool = False) -> int:
    """Return the place of a format in the order of preference; -1 if it cannot be read.

    Formats of more than 8 bits come first if ``deep``.
    """
    if fourcc not in PREFERENCE:
        return -1
    first = deep and GREY.get(fourcc, "u1") != "u1"
    return PREFERENCE.index(fourcc) + (0 if first else len(PREFERENCE) * deep)


def raw_picture(data: NDArray[np.uint8], form: Granted, converter: FrameConverter) -> Picture:
    """Return a picture of a buffer, (n,) uint8, whose memory is copied.

    The format is neither ``MJPG`` nor ``JPEG``.

    Raises:
        PayloadError: ``wrong_size``: the driver delivered only a part of the picture.
    """
    if form.fourcc in GREY:
        return PixelPicture(_grey(data, form))
    if form.fourcc == "YUYV" and not (form.is_bt709 or form.is_full_range or form.width % 2):
        rows = _rows(data, 0, form.stride, form.height, form.width * 2)
        return PackedPicture(np.ascontiguousarray(rows).reshape(form.height, form.width, 2))
    layout = LAYOUTS[form.fourcc]
    frame = VideoFrame(form.width, form.height, layout.name)
    if frame.format.is_rgb or layout.name.startswith("bayer"):
        frame.color_range = ColorRange.JPEG
    else:
        frame.colorspace = BT_709 if form.is_bt709 else BT_601
        frame.color_range = ColorRange.JPEG if form.is_full_range else ColorRange.MPEG
    _fill(frame, data, form, layout)
    return converter.picture(frame)


def _grey(data: NDArray[np.uint8], form: Granted) -> NDArray[Any]:
    dtype = np.dtype(GREY[form.fourcc])
    rows = _rows(data, 0, form.stride, form.height, form.width * dtype.itemsize)
    pixels = np.ascontiguousarray(rows).view(dtype)
    return pixels if dtype.itemsize == 1 else pixels.astype("<u2", copy=False)


def _fill(frame: VideoFrame, data: NDArray[np.uint8], form: Granted, layout: Layout) -> None:
    """Copy a buffer into the planes of a frame."""
    planes = frame.planes
    offset = 0
    for place, (number, share, height) in enumerate(layout.planes):
        stride, rows = int(form.stride * share), -int(-form.height * height // 1)
        plane = planes[number]
        target = np.ndarray((rows, plane.line_size), np.uint8, memoryview(plane))
        if layout.interleaved and place:
            pairs = _rows(data, offset, stride, rows, plane.width * 2)
            target[:, : plane.width] = pairs[:, place - 1 :: 2]
            continue  # the other plane has the other samples of the same rows
        width = min(plane.line_size, stride)
        if layout.order:
            width -= width % len(layout.order)
        row = _rows(data, offset, stride, rows, width)
        if layout.order:
            fours = row.reshape(rows, -1, len(layout.order))
            row = fours[..., layout.order].reshape(rows, width)
        target[:, :width] = row
        if layout.bits < 16:
            values = target.view("<u2")
            values <<= 16 - layout.bits
        offset += stride * rows


def _rows(
    data: NDArray[np.uint8], offset: int, stride: int, rows: int, width: int
) -> NDArray[np.uint8]:
    """Return a view of rows in a buffer, (rows, width).

    Raises:
        PayloadError: ``wrong_size``.
    """
    needed = offset + stride * (rows - 1) + width
    if data.size < needed:
        raise PayloadError("wrong_size", f"{data.size} of {needed} bytes")
    return np.ndarray((rows, width), np.uint8, data, offset, (stride, 1))
