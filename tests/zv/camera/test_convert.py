"""From a source's picture to that of the frame that is published."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from tests.support.pictures.encoded import SCENE
from zenoh_vision.errors import PayloadError
from zenoh_vision.image import codecs, pixel_formats
from zenoh_vision.image.picture import JpegPicture, Picture, PixelPicture
from zenoh_vision.image.pixel_formats import DISTANCES
from zenoh_vision.image.planar import PlanarPicture
from zv.camera.convert import Converter
from zv.camera.geometry import Geometry

GRAY = np.ascontiguousarray(SCENE[:, :, 1])
DEEP = GRAY.astype(np.uint16) * 257 + 3
JPEG = codecs.encode_jpeg(SCENE, "bgr8", 90)
GRAY_JPEG = codecs.encode_jpeg(GRAY, "mono8", 90)
FLAWED_JPEG = JPEG[:-2] + b"\x55" * 20 + JPEG[-2:]  # bytes too many: libjpeg warns
DECODED = cv2.imdecode(np.frombuffer(JPEG, np.uint8), cv2.IMREAD_COLOR)
DECODED_GRAY = cv2.imdecode(np.frombuffer(JPEG, np.uint8), cv2.IMREAD_GRAYSCALE)


def converted(picture: Picture, encoding: str = "bgr8", flip: str = "none") -> Picture:
    return Converter().picture(picture, Geometry(flip), encoding, 1)


def packet(jpeg: bytes = JPEG, encoding: str = "bgr8") -> JpegPicture:
    return JpegPicture(jpeg, encoding, (64, 48), strict=False)


@pytest.mark.parametrize(
    ("jpeg", "source", "encoding", "flip", "untouched"),
    [
        (JPEG, "bgr8", "bgr8", "none", True),
        (JPEG, "bgr8", "rgb8", "none", True),
        (JPEG, "bgr8", "rgba8", "none", True),
        (GRAY_JPEG, "mono8", "mono8", "none", True),
        (GRAY_JPEG, "mono8", "bgr8", "none", True),
        (JPEG, "bgr8", "mono8", "none", False),
        (JPEG, "bgr8", "mono16", "none", False),
        (GRAY_JPEG, "mono8", "mono16", "none", False),
        (JPEG, "bgr8", "bgr8", "horizontal", False),
        (JPEG, "bgr8", "bgr8", "vertical", False),
        (JPEG, "bgr8", "bgr8", "both", False),
        (FLAWED_JPEG, "bgr8", "bgr8", "none", False),
    ],
)
def test_a_packet_passes_through_untouched_if_and_only_if_nothing_must_change(
    jpeg: bytes, source: str, encoding: str, flip: str, untouched: bool
):
    picture = converted(packet(jpeg, source), encoding, flip)
    assert (picture.compressed(80) is jpeg) is untouched
    assert picture.encoding == encoding
    shown = cv2.imdecode(np.frombuffer(jpeg, np.uint8), cv2.IMREAD_COLOR)
    if untouched and source == "bgr8":
        assert np.array_equal(picture.pixels, pixel_formats.convert(shown, "bgr8", encoding))


def test_packets_are_judged_anew_in_each_epoch_until_one_is_sound(monkeypatch: pytest.MonkeyPatch):
    decoded: list[bytes] = []
    real = codecs.decode_jpeg

    def decode(jpeg: bytes, encoding: str, *arguments: object, **options: object) -> np.ndarray:
        if not options:  # strictly, to judge it
            decoded.append(jpeg)
        return real(jpeg, encoding, *arguments, **options)

    monkeypatch.setattr(codecs, "decode_jpeg", decode)
    converter, sound, flawed = Converter(), packet(), packet(FLAWED_JPEG)
    given = [(sound, 1), (sound, 1), (sound, 2), (sound, 2), (flawed, 3), (sound, 3), (flawed, 3)]
    passed = [
        converter.picture(picture, Geometry(), "bgr8", epoch) is picture for picture, epoch in given
    ]
    assert passed == [True, True, True, True, False, True, True]
    assert decoded == [JPEG, JPEG, FLAWED_JPEG, JPEG]


def test_a_flawed_packet_is_encoded_anew_so_that_receivers_accept_it():
    with pytest.raises(PayloadError):
        codecs.decode_jpeg(FLAWED_JPEG, "bgr8")
    picture = converted(packet(FLAWED_JPEG))
    assert np.array_equal(picture.pixels, DECODED)
    assert codecs.decode_jpeg(picture.compressed(80), "bgr8").shape == (48, 64, 3)


@pytest.mark.parametrize("flip", ["none", "horizontal", "vertical", "both"])
def test_16_bits_are_flipped_exactly(flip: str):
    picture = converted(PixelPicture(DEEP), "mono16", flip)
    rows = -1 if flip in ("vertical", "both") else 1
    columns = -1 if flip in ("horizontal", "both") else 1
    assert np.array_equal(picture.pixels, DEEP[::rows, ::columns])
    assert np.array_equal(codecs.decode_png(picture.compressed(80)), picture.pixels)


@pytest.mark.parametrize("source", pixel_formats.ENCODINGS)
@pytest.mark.parametrize("target", pixel_formats.ENCODINGS)
def test_pixels_become_the_encoding_asked_for(source: str, target: str):
    pixels = DEEP if source == "mono16" else pixel_formats.convert(SCENE, "bgr8", source)
    if target in DISTANCES and source not in pixel_formats.DEEP:
        return  # refused, see below
    picture = converted(PixelPicture(pixels, source), target)
    assert np.array_equal(picture.pixels, pixel_formats.convert(pixels, source, target))
    same = source == target or {source, target} == {"mono16", "16UC1"}  # two names for 16 bits
    assert np.shares_memory(picture.pixels, pixels) == same


@pytest.mark.parametrize(
    ("encoding", "flip", "expected"),
    [
        ("mono8", "none", DECODED_GRAY),
        ("mono16", "none", DECODED_GRAY.astype(np.uint16) * 257),
        ("bgr8", "horizontal", DECODED[:, ::-1]),
    ],
    ids=["mono8", "mono16", "bgr8"],
)
def test_a_packet_that_must_change_is_decoded_as_opencv_decodes_it(
    encoding: str, flip: str, expected: np.ndarray
):
    found = converted(packet(), encoding, flip).pixels
    assert found.dtype == expected.dtype
    assert np.array_equal(found, expected)


def test_a_packet_that_cannot_be_repaired_is_corrupt():
    with pytest.raises(PayloadError) as caught:
        converted(packet(JPEG[:100]))
    assert caught.value.reason == "corrupt"


@pytest.mark.parametrize(
    "picture",
    [
        JpegPicture(JPEG, "bgr8", (7681, 4320)),
        PixelPicture(np.broadcast_to(np.uint8(0), (4320, 7681))),
    ],
    ids=["packet", "pixels"],
)
def test_a_picture_over_8k_is_refused(picture: Picture):
    with pytest.raises(PayloadError) as caught:
        converted(picture)
    assert caught.value.reason == "too_large"


def test_the_values_of_16_bits_become_millimetres_and_metres_as_they_are():
    deep = PixelPicture(np.array([[0, 1, 2500, 65535]], np.uint16))
    assert converted(deep, "16UC1").pixels.tolist() == [[0, 1, 2500, 65535]]
    as_metres = converted(deep, "32FC1", "horizontal").pixels
    assert np.allclose(as_metres, np.float32([[65.535, 2.5, 0.001, np.nan]]), equal_nan=True)


@pytest.mark.parametrize("picture", [packet(), PixelPicture(GRAY)], ids=["packet", "grey"])
def test_grey_levels_and_colours_are_never_published_as_depth(picture: Picture):
    with pytest.raises(PayloadError, match="encoding = 16UC1 is depth, but the source delivers"):
        converted(picture, "16UC1")


def test_pictures_of_several_kinds_are_checked_and_converted_each_in_its_way():
    converter = Converter()
    grey, deep, huge = (
        PixelPicture(np.broadcast_to(dtype(7), shape))
        for dtype, shape in ((np.uint8, (4, 6)), (np.uint16, (4, 6)), (np.uint16, (4320, 7681)))
    )
    for _ in range(2):
        found = converter.picture(deep, Geometry(), "16UC1", 1)
        assert (found.encoding, found.size) == ("16UC1", (6, 4))
        for refused in (grey, huge):
            with pytest.raises(PayloadError):
                converter.picture(refused, Geometry(), "16UC1", 1)
        assert converter.picture(grey, Geometry(), "mono8", 1) is grey
        assert converter.picture(grey, Geometry(rotate=90), "mono8", 1).size == (4, 6)
        assert converter.picture(grey, Geometry(), "bgr8", 1).encoding == "bgr8"


@pytest.mark.parametrize("flip", ["none", "both"])
def test_planes_are_encoded_as_they_are_unless_they_must_change(flip: str):
    grey = (np.full((48, 64), 100, np.uint8), *(np.full((24, 32), 128, np.uint8),) * 2)
    planar = PlanarPicture(grey, full_range=True, to_bgr=lambda: SCENE)
    picture = converted(planar, flip=flip)
    assert (picture is planar) is (flip == "none")
    assert np.array_equal(picture.pixels, SCENE[::-1, ::-1] if flip == "both" else SCENE)
