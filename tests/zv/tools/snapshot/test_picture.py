"""A picture in the form that the file's name asks for, against OpenCV as the other reader."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from tests.support.pictures.encoded import STILL, damaged, scene
from zenoh_vision.errors import ConfigurationError, ExpectationNotMet
from zenoh_vision.keys import BITS, JPEG, PNG, RAW_IMAGE
from zenoh_vision.messages import Header
from zenoh_vision.stream.sample import Sample
from zv.tools.snapshot.picture import Picture, checked

COLOUR = scene(3)
DEEP = (np.arange(240 * 320, dtype=np.uint32) * 7 % 65536).astype(np.uint16).reshape(240, 320)


def header(encoding: str) -> Header:
    return Header(
        camera="front", epoch=1, seq=2, stamp_ns=3, width=320, height=240, encoding=encoding
    )


def sample(mime: str, payload: bytes, encoding: str = "bgr8") -> Sample:
    return Sample("vision/front/x", payload, mime, header(encoding).to_bytes())


def picture(mime: str, payload: bytes, encoding: str = "bgr8") -> Picture:
    return checked(sample(mime, payload, encoding))


def png(pixels) -> bytes:
    return bytes(cv2.imencode(".png", pixels)[1])


def seen(file: bytes):
    return cv2.imdecode(np.frombuffer(file, np.uint8), cv2.IMREAD_UNCHANGED)


@pytest.mark.parametrize(
    ("mime", "payload", "output"),
    [
        (JPEG, STILL, "a.jpg"),
        (JPEG, STILL, "a.JPEG"),
        (JPEG, STILL, "-"),
        (PNG, png(COLOUR), "a.png"),
        (PNG, png(DEEP), "a.png"),
        (PNG, png(DEEP), "-"),
    ],
)
def test_what_fits_is_saved_byte_by_byte(mime, payload, output):
    assert picture(mime, payload).file(output, 90) == payload


def test_a_jpeg_saved_as_png_has_the_pixels_that_were_decoded():
    assert np.array_equal(seen(picture(JPEG, STILL).file("a.png", 90)), seen(STILL))


def test_a_png_saved_as_jpeg_looks_the_same():
    file = picture(PNG, png(COLOUR)).file("a.jpg", 95)
    assert file.startswith(b"\xff\xd8")
    assert np.abs(seen(file).astype(int) - COLOUR).mean() < 2


@pytest.mark.parametrize(
    ("encoding", "pixels", "expected"),
    [
        ("bgr8", COLOUR, COLOUR),
        ("rgb8", COLOUR[:, :, ::-1], COLOUR),
        ("mono8", COLOUR[:, :, 1], COLOUR[:, :, 1]),
        ("mono16", DEEP, DEEP),
        ("16UC1", DEEP, DEEP),
        ("32FC1", DEEP.astype(np.float32) / 1000, DEEP),
        (
            "rgba8",
            np.dstack([COLOUR[:, :, ::-1], COLOUR[:, :, 0]]),
            np.dstack([COLOUR, COLOUR[:, :, 0]]),
        ),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)
@pytest.mark.parametrize("output", ["a.png", "-"])
def test_raw_pixels_become_a_lossless_png(encoding, pixels, expected, output):
    raw = np.ascontiguousarray(pixels).tobytes()
    assert np.array_equal(seen(picture(RAW_IMAGE, raw, encoding).file(output, 90)), expected)


@pytest.mark.parametrize("output", ["a.png", "-"])
def test_packed_bits_become_a_lossless_png_of_0_and_255(output):
    edges = (COLOUR[:, :, 0] > 128).astype(np.uint8)
    packed = np.packbits(edges, axis=1).tobytes()  # 320 columns, so that no row is padded
    assert np.array_equal(seen(picture(BITS, packed, "mono8").file(output, 90)), 255 * edges)


def test_packed_bits_become_a_jpeg():
    edges = np.zeros((240, 320), np.uint8)
    edges[:, 160:] = 1
    file = picture(BITS, np.packbits(edges, axis=1).tobytes(), "mono8").file("a.jpg", 95)
    assert np.array_equal(seen(file) > 128, edges > 0)


def test_raw_pixels_become_a_jpeg():
    file = picture(RAW_IMAGE, COLOUR.tobytes()).file("a.jpg", 95)
    assert np.abs(seen(file).astype(int) - COLOUR).mean() < 2


@pytest.mark.parametrize(
    ("mime", "payload", "encoding"),
    [
        (PNG, png(DEEP), "mono16"),
        (RAW_IMAGE, DEEP.tobytes(), "mono16"),
        (PNG, png(DEEP), "bgr8"),
        (RAW_IMAGE, DEEP.astype(np.float32).tobytes(), "32FC1"),
    ],
    ids=["PNG", "raw", "PNG with a wrong word in the header", "metres"],
)
def test_16_bits_do_not_go_into_a_jpeg_and_the_way_out_is_named(mime, payload, encoding):
    with pytest.raises(ConfigurationError) as caught:
        picture(mime, payload, encoding).file("folder/a.jpg", 90)
    assert str(caught.value).endswith("which a JPEG cannot represent: -o folder/a.png")


@pytest.mark.parametrize("key", ["vision/front/x", "Elsewhere/My-Camera/x", "x"])
def test_a_picture_without_a_header_is_saved_all_the_same(key):
    bare = checked(Sample(key, STILL, JPEG))
    assert bare.header is None
    assert bare.file("a.jpg", 90) == STILL
    assert np.array_equal(seen(bare.file("a.png", 90)), seen(STILL))


BROKEN = {
    "damaged": sample(JPEG, damaged(STILL)),
    "JPEG cut short": sample(JPEG, STILL[:-400]),
    "PNG cut short": sample(PNG, png(COLOUR)[:-20]),
    "wrong size": sample(RAW_IMAGE, b"123"),
    "unknown encoding": sample(RAW_IMAGE, COLOUR.tobytes(), "yuv422"),
    "raw without a header": Sample("vision/front/x", COLOUR.tobytes(), RAW_IMAGE),
    "of another camera": Sample("vision/rear/x", STILL, JPEG, header("bgr8").to_bytes()),
}


@pytest.mark.parametrize("broken", BROKEN.values(), ids=BROKEN)
def test_what_is_broken_is_refused_and_named(broken):
    with pytest.raises(ExpectationNotMet, match=f"{broken.key}: "):
        checked(broken)
