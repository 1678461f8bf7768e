"""Pixels in every encoding, as JPEG, PNG and raw bytes; OpenCV as the second decoder.

That PNG and raw bytes give back the pixels, test_forms.py asks.
"""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from tests.support.headers import header
from tests.support.pictures.encoded import SCENE, noise
from zenoh_vision.errors import PayloadError
from zenoh_vision.image import codecs, pixel_formats
from zenoh_vision.image.forms import RAW_FORM

EIGHT_BITS = ["mono8", "bgr8", "rgb8", "bgra8", "rgba8"]


def by_opencv(picture: bytes, flags: int) -> np.ndarray:
    found = cv2.imdecode(np.frombuffer(picture, np.uint8), flags)
    assert found is not None
    return np.asarray(found)


def test_raw_16_bit_pixels_are_little_endian():
    raw = pixel_formats.to_raw(np.array([[0x0102, 0xFFFE]], ">u2"), "mono16")
    assert raw == b"\x02\x01\xfe\xff"


def test_raw_rows_are_without_padding_even_from_a_view():
    view = noise("bgr8", 8, 4)[::2, 1:4]
    assert pixel_formats.to_raw(view, "bgr8") == b"".join(row.tobytes() for row in view)


@pytest.mark.parametrize("change", [-1, 1], ids=["one byte less", "one byte more"])
@pytest.mark.parametrize("encoding", pixel_formats.ENCODINGS)
def test_raw_pixels_of_another_length_are_refused(encoding: str, change: int):
    raw = pixel_formats.to_raw(noise(encoding, 31, 17), encoding)
    about, other = (
        header(encoding=encoding, width=31, height=17),
        (raw + b"\0")[: len(raw) + change],
    )
    for look in (RAW_FORM.check, lambda *given: RAW_FORM.open(*given, None)):
        with pytest.raises(PayloadError) as caught:
            look(other, about)
        assert caught.value.reason == "wrong_size"
        sizes = f"{len(raw) + change} bytes, 31x17 {encoding} has {len(raw)}"
        assert sizes in str(caught.value)


@pytest.mark.parametrize("encoding", [None, "", "bgr16", "BGR8", "yuv422"])
def test_an_encoding_nobody_knows_is_refused_listing_the_known(encoding: str | None):
    with pytest.raises(PayloadError, match="mono8, mono16, bgr8, rgb8, bgra8, rgba8") as caught:
        pixel_formats.raw_size(encoding, 4, 4)
    assert caught.value.reason == "unsupported_encoding"


# One pixel: blue 10, green 100, red 200. Grey is 0.299 R + 0.587 G + 0.114 B
# = 59.8 + 58.7 + 1.14 = 119.64, rounded 120, in 16 bits 120 * 257 = 30840.
@pytest.mark.parametrize(
    ("source", "pixel"),
    [
        ("bgr8", [10, 100, 200]),
        ("rgb8", [200, 100, 10]),
        ("bgra8", [10, 100, 200, 7]),
        ("rgba8", [200, 100, 10, 7]),
    ],
    ids=["bgr8", "rgb8", "bgra8", "rgba8"],
)
@pytest.mark.parametrize(
    ("target", "expected"),
    [
        ("bgr8", [10, 100, 200]),
        ("rgb8", [200, 100, 10]),
        ("bgra8", [10, 100, 200, 255]),
        ("rgba8", [200, 100, 10, 255]),
        ("mono8", 120),
        ("mono16", 30840),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_a_colour_pixel_in_another_encoding(
    source: str, pixel: list[int], target: str, expected: list[int] | int
):
    if source.endswith("a8") and target.endswith("a8"):
        expected = [*expected[:3], 7]  # alpha that is there is kept
    pixels = np.array([[pixel]], np.uint8)
    assert pixel_formats.convert(pixels, source, target)[0, 0].tolist() == expected


@pytest.mark.parametrize(
    ("target", "expected"),
    [("bgr8", [9, 9, 9]), ("rgb8", [9, 9, 9]), ("bgra8", [9, 9, 9, 255]), ("mono16", 2313)],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_a_grey_pixel_in_another_encoding(target: str, expected: list[int] | int):
    assert (
        pixel_formats.convert(np.array([[9]], np.uint8), "mono8", target)[0, 0].tolist() == expected
    )


# 257 * k is k in 8 bits; 128 more still rounds down (128 / 257 < 0.5), 129 more rounds up.
@pytest.mark.parametrize(
    ("sixteen", "eight"),
    [
        (0, 0),
        (128, 0),
        (129, 1),
        (257, 1),
        (385, 1),
        (386, 2),
        (32896, 128),
        (65407, 255),
        (65406, 254),
        (65535, 255),
    ],
)
def test_16_bits_become_8_rounded(sixteen: int, eight: int):
    pixels = np.array([[sixteen]], np.uint16)
    assert pixel_formats.convert(pixels, "mono16", "mono8").tolist() == [[eight]]
    assert pixel_formats.convert(pixels, "mono16", "bgr8").tolist() == [[[eight] * 3]]


def test_8_bits_survive_16_exactly():
    every = np.arange(256, dtype=np.uint8).reshape(16, 16)
    wide = pixel_formats.convert(every, "mono8", "mono16")
    assert (wide.dtype, wide.max()) == (np.uint16, 65535)
    assert np.array_equal(pixel_formats.convert(wide, "mono16", "mono8"), every)


@pytest.mark.parametrize("source", EIGHT_BITS)
@pytest.mark.parametrize("target", [*EIGHT_BITS, "mono16", "16UC1", "32FC1"])
def test_every_conversion_exists_and_leaves_its_input_alone(source: str, target: str):
    pixels = noise(source, 31, 17)
    before = pixels.copy()
    converted = pixel_formats.convert(pixels, source, target)
    assert pixel_formats.to_raw(converted, target)
    assert converted.shape[2:] == noise(target, 31, 17).shape[2:]
    assert np.array_equal(pixels, before)
    assert (converted is pixels) == (source == target)


@pytest.mark.parametrize("quality", [50, 80, 95])
def test_jpegs_decode_as_opencv_decodes_them(quality: int):
    jpeg = codecs.encode_jpeg(SCENE, "bgr8", quality)
    colour = codecs.decode_jpeg(jpeg, "bgr8")
    assert np.array_equal(colour, by_opencv(jpeg, cv2.IMREAD_COLOR))
    assert np.array_equal(codecs.decode_jpeg(jpeg, "rgb8"), colour[:, :, ::-1])
    assert np.array_equal(codecs.decode_jpeg(jpeg, "mono8"), by_opencv(jpeg, cv2.IMREAD_GRAYSCALE))
    assert np.abs(colour.astype(int) - SCENE).mean() < 12


@pytest.mark.parametrize("progressive", [0, 1], ids=["baseline", "progressive"])
def test_jpegs_of_opencv_decode_as_opencv_decodes_them(progressive: int):
    _, buffer = cv2.imencode(".jpg", SCENE, [cv2.IMWRITE_JPEG_PROGRESSIVE, progressive])
    jpeg = buffer.tobytes()
    assert codecs.picture_size(jpeg) == (64, 48)
    assert np.array_equal(codecs.decode_jpeg(jpeg, "bgr8"), by_opencv(jpeg, cv2.IMREAD_COLOR))


@pytest.mark.parametrize("encoding", EIGHT_BITS)
def test_every_8_bit_encoding_makes_the_same_jpeg_picture(encoding: str):
    jpeg = codecs.encode_jpeg(pixel_formats.convert(SCENE, "bgr8", encoding), encoding, 90)
    if encoding == "mono8":
        assert by_opencv(jpeg, cv2.IMREAD_UNCHANGED).ndim == 2
    else:
        assert jpeg == codecs.encode_jpeg(SCENE, "bgr8", 90)


def test_a_grey_jpeg_decodes_to_equal_channels():
    gray = np.ascontiguousarray(SCENE[:, :, 0])
    jpeg = codecs.encode_jpeg(gray, "mono8", 90)
    bgr = codecs.decode_jpeg(jpeg, "bgr8")
    assert codecs.decode_jpeg(jpeg, "mono8").shape == (48, 64)
    assert all(np.array_equal(bgr[:, :, i], codecs.decode_jpeg(jpeg, "mono8")) for i in range(3))


def test_a_bilevel_png_is_exact_and_one_bit_deep():
    mask = np.where(noise("mono8", 31, 17) > 127, 255, 0).astype(np.uint8)
    png = codecs.encode_png(mask, bilevel=True)
    assert png[24] == 1  # bit depth, the byte behind width and height in IHDR
    assert np.array_equal(codecs.decode_png(png), mask)
    assert np.array_equal(by_opencv(png, cv2.IMREAD_UNCHANGED), mask)


def test_pixels_that_no_png_can_hold_are_a_programming_error():
    with pytest.raises((ValueError, cv2.error)):
        codecs.encode_png(np.zeros((0, 4), np.uint8))


def test_a_jpeg_is_decoded_at_the_smallest_scale_that_is_large_enough():
    pixels = np.zeros((480, 640, 3), np.uint8)
    pixels[:, 320:] = 200
    jpeg = codecs.encode_jpeg(pixels, "bgr8", 95)
    assert codecs.decode_jpeg(jpeg, "bgr8").shape == (480, 640, 3)
    half = codecs.decode_jpeg(jpeg, "bgr8", (320, 200))
    assert half.shape == (240, 320, 3)
    assert (int(half[100, 50, 0]), int(half[100, 300, 0])) == (0, 200)
    assert codecs.decode_jpeg(jpeg, "mono8", (70, 50)).shape == (60, 80)  # an eighth is enough
    assert codecs.decode_jpeg(jpeg, "mono8", (9999, 9999)).shape == (480, 640)


def test_the_size_of_pictures_that_begin_alike_is_read_once(monkeypatch: pytest.MonkeyPatch):
    first, second = (codecs.encode_jpeg(noise("bgr8", 31, 17), "bgr8", 71) for _ in range(2))
    assert codecs.picture_size(first) == (31, 17)
    monkeypatch.setattr(codecs, "check_scans", None)
    assert codecs.picture_size(second) == (31, 17)
    assert codecs.decode_jpeg(second, "bgr8").shape == (17, 31, 3)


def test_pictures_that_begin_alike_but_are_of_another_size_have_their_own():
    for size in ((31, 17), (17, 31), (31, 18), (31, 17)):
        assert codecs.picture_size(codecs.encode_jpeg(noise("bgr8", *size), "bgr8", 71)) == size


@pytest.mark.parametrize(
    "options",
    [(cv2.IMWRITE_JPEG_PROGRESSIVE, 1), (cv2.IMWRITE_JPEG_QUALITY, 80)],
    ids=["progressive", "one scan"],
)
def test_only_a_picture_of_one_scan_is_known_by_its_beginning(options: tuple[int, int]):
    jpeg = cv2.imencode(".jpg", noise("bgr8", 33, 19), options)[1].tobytes()
    codecs.picture_size(jpeg)
    is_known = any(jpeg.startswith(head) for head, _ in codecs._known_heads)
    assert is_known is (options[0] != cv2.IMWRITE_JPEG_PROGRESSIVE)


def test_few_beginnings_are_kept_and_no_large_one():
    for width in range(1, 40):
        codecs.picture_size(codecs.encode_jpeg(noise("bgr8", width, 8), "bgr8", 80))
    assert len(codecs._known_heads) == codecs.MAX_KNOWN
    jpeg = codecs.encode_jpeg(noise("bgr8", 41, 8), "bgr8", 80)
    long = jpeg[:2] + b"\xff\xfe" + (5002).to_bytes(2) + bytes(5000) + jpeg[2:]  # a comment
    assert codecs.picture_size(long) == (41, 8)
    assert not any(long.startswith(head) for head, _ in codecs._known_heads)
