"""From a source's picture to the frame that is published."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
import pytest

from tests.support.headers import header
from tests.support.pictures.encoded import SCENE
from zenoh_vision.errors import PayloadError
from zenoh_vision.image import codecs, pixel_formats
from zenoh_vision.image.frame import Frame
from zenoh_vision.image.pixel_formats import DISTANCES
from zenoh_vision.image.planar import PlanarPicture
from zenoh_vision.messages import Track
from zv.camera.convert import Converter, mirrored
from zv.camera.sources.base import Picture

GRAY = np.ascontiguousarray(SCENE[:, :, 1])
DEEP = GRAY.astype(np.uint16) * 257 + 3
JPEG = codecs.encode_jpeg(SCENE, "bgr8", 90)
GRAY_JPEG = codecs.encode_jpeg(GRAY, "mono8", 90)
FLAWED_JPEG = JPEG[:-2] + b"\x55" * 20 + JPEG[-2:]  # bytes too many: libjpeg warns
DECODED = cv2.imdecode(np.frombuffer(JPEG, np.uint8), cv2.IMREAD_COLOR)


def frame_of(
    converter: Converter,
    picture: Picture,
    encoding: str,
    *,
    epoch: int = 1,
    flip: str = "none",
    quality: int = 80,
) -> Frame:
    sent = header(epoch=epoch, encoding=encoding)
    return converter.frame(sent, picture, flip=flip, quality=quality)


def converted(picture: Picture, encoding: str = "bgr8", flip: str = "none") -> Frame:
    return frame_of(Converter(), picture, encoding, flip=flip)


def packet(jpeg: bytes = JPEG, encoding: str = "bgr8") -> Picture:
    return Picture(encoding, 64, 48, jpeg=jpeg)


def born_as_pixels(frame: Frame) -> bool:
    return frame._pixels is not None


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
    frame = converted(packet(jpeg, source), encoding, flip)
    assert born_as_pixels(frame) is not untouched
    assert (frame.compressed is jpeg) is untouched


def test_a_packet_that_passes_through_is_decoded_once_an_epoch(monkeypatch: pytest.MonkeyPatch):
    decoded: list[bytes] = []
    real = codecs.decode_jpeg
    monkeypatch.setattr(
        codecs, "decode_jpeg", lambda jpeg, space: decoded.append(jpeg) or real(jpeg, space)
    )
    converter = Converter()
    for epoch in (1, 1, 1, 2, 2):
        assert frame_of(converter, packet(), "bgr8", epoch=epoch).compressed is JPEG
    assert len(decoded) == 2


def test_a_flawed_packet_is_encoded_anew_so_that_receivers_accept_it():
    with pytest.raises(PayloadError):
        codecs.decode_jpeg(FLAWED_JPEG, "bgr8")
    frame = converted(packet(FLAWED_JPEG))
    assert np.array_equal(frame.pixels, DECODED)
    assert codecs.decode_jpeg(frame.compressed, "bgr8").shape == (48, 64, 3)


def test_one_flawed_packet_at_the_start_does_not_end_passing_through():
    converter = Converter()
    flawed = frame_of(converter, packet(FLAWED_JPEG), "bgr8", epoch=1)
    sound = frame_of(converter, packet(), "bgr8", epoch=1)
    assert [born_as_pixels(frame) for frame in (flawed, sound)] == [True, False]


def test_packets_are_judged_anew_in_each_epoch():
    converter = Converter()
    sound = frame_of(converter, packet(), "bgr8", epoch=1)
    flawed_after_reopening = frame_of(converter, packet(FLAWED_JPEG), "bgr8", epoch=2)
    assert [born_as_pixels(frame) for frame in (sound, flawed_after_reopening)] == [False, True]


FLIPS: dict[str, Any] = {
    "none": lambda pixels: pixels,
    "horizontal": lambda pixels: pixels[:, ::-1],
    "vertical": lambda pixels: pixels[::-1],
    "both": lambda pixels: pixels[::-1, ::-1],
}


@pytest.mark.parametrize("flip", FLIPS)
def test_pixels_are_flipped(flip: str):
    picture = Picture("bgr8", 64, 48, pixels=SCENE)
    assert np.array_equal(converted(picture, flip=flip).pixels, FLIPS[flip](SCENE))
    assert np.array_equal(converted(packet(), flip=flip).pixels, FLIPS[flip](DECODED))


@pytest.mark.parametrize("flip", FLIPS)
def test_16_bits_are_flipped_exactly(flip: str):
    picture = Picture("mono16", 64, 48, pixels=DEEP)
    frame = converted(picture, "mono16", flip)
    assert np.array_equal(frame.pixels, FLIPS[flip](DEEP))
    assert np.array_equal(codecs.decode_png(frame.compressed), FLIPS[flip](DEEP))


@pytest.mark.parametrize("source", pixel_formats.ENCODINGS)
@pytest.mark.parametrize("target", pixel_formats.ENCODINGS)
def test_pixels_become_the_encoding_asked_for(source: str, target: str):
    pixels = DEEP if source == "mono16" else pixel_formats.convert(SCENE, "bgr8", source)
    if target in DISTANCES and source not in pixel_formats.DEEP:
        return  # refused, see below
    frame = converted(Picture(source, 64, 48, pixels=pixels), target)
    assert np.array_equal(frame.pixels, pixel_formats.convert(pixels, source, target))
    same = source == target or {source, target} == {"mono16", "16UC1"}  # two names for 16 bits
    assert np.shares_memory(frame.pixels, pixels) == same


@pytest.mark.parametrize(
    ("encoding", "expected"),
    [
        ("mono8", cv2.imdecode(np.frombuffer(JPEG, np.uint8), cv2.IMREAD_GRAYSCALE)),
        ("bgr8", DECODED[:, ::-1]),
    ],
    ids=["mono8", "bgr8"],
)
def test_a_packet_that_must_change_is_decoded_as_opencv_decodes_it(
    encoding: str, expected: np.ndarray
):
    flip = "none" if encoding == "mono8" else "horizontal"
    assert np.array_equal(converted(packet(), encoding, flip).pixels, expected)


def test_16_bits_of_a_packet_are_its_grey_times_257():
    gray = cv2.imdecode(np.frombuffer(JPEG, np.uint8), cv2.IMREAD_GRAYSCALE)
    found = converted(packet(), "mono16").pixels
    assert found.dtype == np.uint16
    assert np.array_equal(found, gray.astype(int) * 257)


def test_the_quality_is_the_cameras():
    picture = Picture("bgr8", 64, 48, pixels=SCENE)
    expected = codecs.encode_jpeg(SCENE, "bgr8", 33)
    assert frame_of(Converter(), picture, "bgr8", quality=33).compressed == expected


@pytest.mark.parametrize("jpeg", [b"", b"no JPEG", JPEG[:100]], ids=["empty", "text", "cut off"])
def test_a_packet_that_cannot_be_repaired_is_corrupt(jpeg: bytes):
    with pytest.raises(PayloadError) as caught:
        converted(packet(jpeg))
    assert caught.value.reason == "corrupt"


@pytest.mark.parametrize(
    "picture",
    [
        Picture("bgr8", 7681, 4320, jpeg=JPEG),
        Picture("mono8", 7681, 4320, pixels=np.broadcast_to(np.uint8(0), (4320, 7681))),
    ],
    ids=["packet", "pixels"],
)
def test_a_picture_over_8k_is_refused(picture: Picture):
    with pytest.raises(PayloadError) as caught:
        converted(picture)
    assert caught.value.reason == "too_large"


@pytest.mark.parametrize("flip", ["none", "horizontal", "vertical", "both"])
@pytest.mark.parametrize("box", [(3, 5, 10, 7), (0, 0, 64, 48), (63, 47, 1, 1), (20, 8, 11, 12)])
def test_the_truth_is_where_the_thing_is_in_the_flipped_picture(
    flip: str, box: tuple[int, int, int, int]
):
    left, top, width, height = box
    painted = np.zeros((48, 64), np.uint8)
    painted[top : top + height, left : left + width] = 255
    track = Track(id=1, state="confirmed", x=0.0, y=0.0, box=box, area=70.0, vx=3.0, vy=-2.0)
    (found,) = mirrored((found_in(painted, track),), flip, 64, 48)
    shown = converted(Picture("mono8", 64, 48, pixels=painted), "mono8", flip).pixels
    expected = found_in(shown, track)
    assert found.box == expected.box
    assert (found.x, found.y) == (expected.x, expected.y)
    signs = {"none": (1, 1), "horizontal": (-1, 1), "vertical": (1, -1), "both": (-1, -1)}[flip]
    assert (found.vx, found.vy) == (3.0 * signs[0], -2.0 * signs[1])
    assert (found.id, found.area) == (1, 70.0)


def found_in(picture: Any, track: Track) -> Track:
    """Return the track with the place of what is white, by OpenCV."""
    left, top, width, height = cv2.boundingRect(np.asarray(picture))
    center = {"x": float(left + int(width / 2)), "y": float(top + int(height / 2))}
    return track.model_copy(update={"box": (left, top, width, height), **center})


def test_without_a_flip_the_truth_stays_as_it_is():
    track = Track(id=1, state="confirmed", x=1.5, y=2.5, box=(1, 2, 3, 4), area=5.0)
    assert mirrored((track,), "none", 64, 48) == (track,)


def deep(pixels: np.ndarray[Any, Any] = DEEP, encoding: str = "mono16") -> Picture:
    return Picture(encoding, 64, 48, pixels)


def test_the_values_of_16_bits_become_millimetres_and_metres_as_they_are():
    pixels = np.array([[0, 1, 2500, 65535]], np.uint16)
    as_millimetres = frame_of(Converter(), deep(pixels), "16UC1")
    as_metres = frame_of(Converter(), deep(pixels), "32FC1", flip="horizontal")
    assert as_millimetres.pixels.tolist() == [[0, 1, 2500, 65535]]
    assert np.allclose(as_metres.pixels, np.float32([[65.535, 2.5, 0.001, np.nan]]), equal_nan=True)


@pytest.mark.parametrize("picture", [packet(), Picture("mono8", 64, 48, GRAY)])
def test_grey_levels_and_colours_are_never_published_as_depth(picture):
    with pytest.raises(PayloadError, match="encoding = 16UC1 is depth, but the source delivers"):
        converted(picture, "16UC1")


def planar(bgr: Any) -> PlanarPicture:
    grey = (np.full((48, 64), 100, np.uint8), *(np.full((24, 32), 128, np.uint8),) * 2)
    return PlanarPicture(grey, full_range=True, to_bgr=lambda: bgr)


@pytest.mark.parametrize(
    ("encoding", "flip", "is_encoded_from_planes"),
    [
        ("bgr8", "none", True),
        ("rgba8", "none", True),
        ("bgr8", "both", False),
        ("mono8", "none", False),
        ("mono16", "none", False),
    ],
)
def test_planes_are_encoded_unless_they_must_change(
    encoding: str, flip: str, is_encoded_from_planes: bool
):
    found = converted(Picture("bgr8", 64, 48, stored=planar(SCENE)), encoding, flip)
    assert born_as_pixels(found) is not is_encoded_from_planes
    expected = pixel_formats.convert(FLIPS[flip](SCENE), "bgr8", encoding)
    assert np.array_equal(found.pixels, expected)
    if is_encoded_from_planes:
        assert np.abs(codecs.decode_jpeg(found.compressed, "mono8").astype(int) - 100).max() <= 1
