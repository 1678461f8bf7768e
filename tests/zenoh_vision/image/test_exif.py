"""Which way up an image is, in each kind of file that says so."""

from __future__ import annotations

import struct
import zlib

import cv2
import numpy as np
import pytest

from tests.support.pictures.videos import colour_bars, jpeg_of, with_orientation
from zenoh_vision.image.exif import as_stored, orientation_of, upright
from zenoh_vision.image.files import decoded

STORED = colour_bars()
# What the values of the tag mean, Exif 2.3: which edges of the scene are row 0 and column 0.
SHOWN = {
    1: STORED,
    2: STORED[:, ::-1],
    3: STORED[::-1, ::-1],
    4: STORED[::-1],
    5: STORED.swapaxes(0, 1),
    6: np.rot90(STORED, -1),
    7: STORED[::-1, ::-1].swapaxes(0, 1),
    8: np.rot90(STORED),
}


def exif(orientation: int, order: str) -> bytes:
    jpeg = with_orientation(b"\xff\xd8", orientation, order)
    return jpeg[jpeg.index(b"Exif\0\0") + 6 :]


def png_with(data: bytes) -> bytes:
    png = cv2.imencode(".png", STORED)[1].tobytes()
    body = b"eXIf" + data
    chunk = len(data).to_bytes(4, "big") + body + zlib.crc32(body).to_bytes(4, "big")
    return png[:33] + chunk + png[33:]  # after the header


def webp_with(data: bytes) -> bytes:
    webp = cv2.imencode(".webp", STORED, [cv2.IMWRITE_WEBP_QUALITY, 101])[1].tobytes()
    height, width = STORED.shape[:2]
    head = b"VP8X" + (10).to_bytes(4, "little") + b"\x08\0\0\0"
    head += (width - 1).to_bytes(3, "little") + (height - 1).to_bytes(3, "little")
    padded = data + bytes(len(data) % 2)
    body = b"WEBP" + head + webp[12:] + b"EXIF" + len(data).to_bytes(4, "little") + padded
    return b"RIFF" + len(body).to_bytes(4, "little") + body


@pytest.mark.parametrize("order", ["little", "big"])
@pytest.mark.parametrize("orientation", SHOWN)
def test_the_tag_is_found_and_heeded_in_png_and_webp(orientation: int, order: str):
    for file in (png_with(exif(orientation, order)), webp_with(exif(orientation, order))):
        assert orientation_of(file) == orientation
        assert np.array_equal(decoded(file).pixels, SHOWN[orientation])


@pytest.mark.parametrize("orientation", SHOWN)
def test_a_jpeg_is_turned_as_opencv_turns_it(orientation: int):
    jpeg = with_orientation(jpeg_of(STORED), orientation)
    assert orientation_of(jpeg) == orientation
    plain = cv2.imdecode(np.frombuffer(jpeg_of(STORED), np.uint8), cv2.IMREAD_COLOR)
    assert np.array_equal(decoded(jpeg).pixels, upright(plain, orientation))


@pytest.mark.parametrize(
    "file",
    [
        jpeg_of(STORED),
        with_orientation(jpeg_of(STORED), 9),
        with_orientation(jpeg_of(STORED), 6)[:26],
        b"\xff\xd8\xff\xe1\xff\xff" + b"Exif\0\0MM\0*\xff\xff\xff\xff",
        b"\xff\xd8" + b"\xff" * 100,
        b"RIFF\xff\xff\xff\xffWEBPEXIF\xff\xff\xff\xff",
        png_with(b"II*\0\x08\0\0\0\xff\xff"),
        b"",
    ],
)
def test_what_says_nothing_or_nonsense_is_upright(file: bytes):
    assert orientation_of(file) == 1


PLAIN = cv2.imencode(".jpg", np.full((16, 32, 3), 90, np.uint8))[1].tobytes()


def with_exif(
    orientation: int, order: str = "<", *, tag: int = 0x0112, before: bytes = b""
) -> bytes:
    """Return a JPEG whose Exif data have one more tag before the orientation."""
    magic = b"II*\0" if order == "<" else b"MM\0*"
    tiff = magic + struct.pack(f"{order}IH", 8, 2)
    tiff += struct.pack(f"{order}HHIHH", 0x0100, 3, 1, 32, 0)
    tiff += struct.pack(f"{order}HHIHH", tag, 3, 1, orientation, 0) + struct.pack(f"{order}I", 0)
    exif = b"Exif\0\0" + tiff
    return PLAIN[:2] + before + b"\xff\xe1" + struct.pack(">H", len(exif) + 2) + exif + PLAIN[2:]


@pytest.mark.parametrize("order", ["<", ">"], ids=["little-endian", "big-endian"])
@pytest.mark.parametrize("orientation", range(2, 9))
def test_every_orientation_becomes_that_of_the_pixels(orientation: int, order: str):
    turned = with_exif(orientation, order)
    assert as_stored(turned) == with_exif(1, order)


def test_opencv_which_turns_pictures_as_browsers_do_no_longer_does():
    turned = np.frombuffer(with_exif(6), np.uint8)
    assert cv2.imdecode(turned, cv2.IMREAD_COLOR).shape[:2] == (32, 16)
    stored = np.frombuffer(as_stored(with_exif(6)), np.uint8)
    assert cv2.imdecode(stored, cv2.IMREAD_COLOR).shape[:2] == (16, 32)


def test_it_is_found_behind_other_segments():
    comment = b"\xff\xfe" + struct.pack(">H", 6) + b"hey!"
    assert as_stored(with_exif(3, before=comment)) == with_exif(1, before=comment)


@pytest.mark.parametrize(
    "jpeg",
    [PLAIN, with_exif(1), with_exif(6, tag=0x0113), b"", b"\xff\xd8\xff", PLAIN[:30]],
    ids=["none", "upright", "another tag", "empty", "start", "cut"],
)
def test_any_other_picture_stays_the_same(jpeg: bytes):
    assert as_stored(jpeg) is jpeg


def test_no_damage_is_an_error():
    whole = with_exif(6)
    rng = np.random.default_rng(4)
    for length in range(2, 80):
        as_stored(whole[:length])
    for _ in range(2000):
        damaged = bytearray(whole[:120])
        for place in rng.integers(2, 80, 3):
            damaged[place] = rng.integers(256)
        assert len(as_stored(bytes(damaged))) == 120
