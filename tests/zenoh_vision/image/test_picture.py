"""Changes of a picture before it has an identity: crops, mirrors, sizes, and equality."""

from __future__ import annotations

from collections.abc import Callable

import cv2
import numpy as np
import pytest

from tests.support.pictures.encoded import SCENE
from zenoh_vision.errors import PayloadError
from zenoh_vision.image import codecs
from zenoh_vision.image.picture import (
    JpegPicture,
    PixelPicture,
    PngPicture,
    are_equal,
    check_size,
    picture_of,
)

DEPTH = np.arange(48 * 64, dtype=np.uint16).reshape(48, 64) * 7
PICTURES = {
    "pixels": lambda: PixelPicture(SCENE),
    "JPEG": lambda: JpegPicture(codecs.encode_jpeg(SCENE, "bgr8", 95)),
    "PNG": lambda: PngPicture(codecs.encode_png(SCENE)),
    "depth": lambda: PngPicture(codecs.encode_png(DEPTH), "16UC1"),
}


@pytest.fixture(params=PICTURES)
def picture(request: pytest.FixtureRequest):
    return PICTURES[request.param]()


def test_a_crop_has_the_pixels_of_its_rectangle_and_keeps_no_more(picture):
    part = picture.cropped((10, 5, 20, 30))
    assert part.size == (20, 30)
    assert part.encoding == picture.encoding
    assert np.array_equal(part.pixels, picture.pixels[5:35, 10:30])
    assert part.pixels.base is None or part.pixels.base.nbytes == part.pixels.nbytes


@pytest.mark.parametrize(
    ("flip", "expected"),
    [
        ("none", lambda a: a),
        ("horizontal", lambda a: a[:, ::-1]),
        ("vertical", lambda a: a[::-1]),
        ("both", lambda a: a[::-1, ::-1]),
    ],
)
def test_a_picture_is_mirrored_exactly(picture, flip: str, expected):
    turned = picture.turned(flip, picture.encoding)
    assert np.array_equal(turned.pixels, expected(picture.pixels))
    assert (turned is picture) == (flip == "none")


def test_a_smaller_picture_is_averaged_and_values_of_depth_are_picked():
    checks = (np.indices((48, 64)).sum(axis=0) % 2 * 200).astype(np.uint8)
    assert set(np.unique(PixelPicture(checks).scaled(32, 24).pixels)) == {100}
    small = PixelPicture(DEPTH, "16UC1").scaled(16, 12).pixels
    assert small.shape == (12, 16)
    assert np.isin(small, DEPTH).all()


def test_a_jpeg_is_decoded_at_the_scale_that_is_wanted(monkeypatch: pytest.MonkeyPatch):
    least = []
    real = codecs.decode_jpeg

    def decode(jpeg, encoding, size=(0, 0), **options):
        least.append(size)
        return real(jpeg, encoding, size, **options)

    monkeypatch.setattr(codecs, "decode_jpeg", decode)
    assert PICTURES["JPEG"]().scaled(32, 24).size == (32, 24)
    assert least == [(32, 24)]


def test_a_lenient_jpeg_is_decoded_although_it_is_flawed():
    jpeg = codecs.encode_jpeg(SCENE, "bgr8", 90)
    flawed = jpeg[:-2] + b"\x55" * 20 + jpeg[-2:]  # bytes too many: libjpeg warns
    with pytest.raises(PayloadError):
        JpegPicture(flawed).pixels  # noqa: B018
    assert JpegPicture(flawed, strict=False).pixels.shape == SCENE.shape


@pytest.mark.parametrize(
    ("data", "kind", "encoding"),
    [
        (codecs.encode_jpeg(SCENE, "bgr8", 90), JpegPicture, "bgr8"),
        (codecs.encode_png(SCENE), PngPicture, "bgr8"),
        (codecs.encode_png(DEPTH), PngPicture, "mono16"),
    ],
)
def test_a_file_is_opened_by_its_first_bytes(data: bytes, kind: type, encoding: str):
    opened = picture_of(data)
    assert type(opened) is kind
    assert (opened.encoding, opened.size) == (encoding, (64, 48))
    assert opened.compressed(1) is data


def test_grey_of_16_bits_beside_transparency_is_deep_and_stays_so():
    """A chunk tRNS makes OpenCV return several channels of a file whose header says grey."""
    png = codecs.encode_png(DEPTH)
    body = b"tRNS" + (7).to_bytes(2)
    chunk = (2).to_bytes(4) + body + __import__("zlib").crc32(body).to_bytes(4)
    data = png.index(b"IDAT") - 4
    picture = PngPicture(png[:data] + chunk + png[data:], "mono16")
    assert picture.is_deep
    assert picture.depth is not None
    assert np.array_equal(picture.depth, DEPTH)
    assert picture.is_deep


def test_pictures_are_equal_only_within_a_form():
    for make in PICTURES.values():
        assert make().equals(make())
    assert not PICTURES["pixels"]().equals(PICTURES["PNG"]())
    assert not PixelPicture(SCENE).equals(PixelPicture(SCENE[:24]))
    other = SCENE.copy()
    other[24, 0] += 1
    assert not PixelPicture(SCENE).equals(PixelPicture(other))


def test_arrays_are_equal_by_shape_and_all_values():
    one = np.zeros((5, 4), np.uint8)
    assert are_equal(one, one.copy())
    assert not are_equal(one, one[:4])
    for place in ((2, 3), (4, 0)):  # in the middle row, and in another
        other = one.copy()
        other[place] = 1
        assert not are_equal(one, other)


@pytest.mark.parametrize("size", [(0, 5), (65_501, 1), (7681, 4320)], ids=str)
def test_a_size_that_no_jpeg_has_or_no_consumer_takes_is_refused(size: tuple[int, int]):
    with pytest.raises(PayloadError) as caught:
        check_size(*size)
    assert caught.value.reason == "too_large"
    check_size(7680, 4320)


def test_a_png_is_written_with_red_and_blue_in_place():
    rgb = PixelPicture(np.ascontiguousarray(SCENE[:, :, ::-1]), "rgb8")
    assert np.array_equal(cv2.imdecode(np.frombuffer(rgb.png(), np.uint8), 1), SCENE)


PADDED = {
    "before the end": lambda jpeg: jpeg[:-2] + bytes(651) + jpeg[-2:],
    "fill bytes": lambda jpeg: jpeg[:-2] + b"\xff\xff\xff" + jpeg[-2:],
    "before a restart": lambda jpeg: jpeg.replace(b"\xff\xd2", b"\x00\x12\xff\xd2", 1),
}


@pytest.mark.parametrize("pad", PADDED.values(), ids=PADDED)
def test_bytes_that_belong_to_no_picture_are_skipped_and_noted(pad: Callable[[bytes], bytes]):
    jpeg = cv2.imencode(".jpg", SCENE, [cv2.IMWRITE_JPEG_RST_INTERVAL, 2])[1].tobytes()
    plain, padded = JpegPicture(jpeg), JpegPicture(pad(jpeg))
    assert np.array_equal(padded.pixels, plain.pixels)
    assert not plain.has_padding
    assert padded.has_padding == (pad is not PADDED["fill bytes"])  # which are allowed
    target = np.empty(plain.pixels.size, np.uint8)
    JpegPicture(pad(jpeg)).write(target)
    assert np.array_equal(target, plain.pixels.ravel())


def test_a_picture_with_a_part_missing_is_not_taken_for_a_padded_one():
    jpeg = cv2.imencode(".jpg", SCENE)[1].tobytes()
    for kept in (len(jpeg) // 2, len(jpeg) - 40):
        with pytest.raises(PayloadError, match="premature end"):
            JpegPicture(jpeg[:kept] + b"\xff\xd9").pixels  # noqa: B018
