"""A picture in the form that the file's name asks for, against OpenCV as the other reader."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from common.errors import ConfigurationError, ExpectationNotMet
from common.keys import JPEG, PNG, RAW_IMAGE
from common.messages import Header
from services.tools.snapshot.forms import encoded
from services.tools.snapshot.shot import Shot
from tests.integration.pictures import STILL, damaged, scene

COLOUR = scene(3)
DEEP = (np.arange(240 * 320, dtype=np.uint32) * 7 % 65536).astype(np.uint16).reshape(240, 320)


def header(encoding: str | None) -> Header:
    return Header(
        camera="front", epoch=1, seq=2, stamp_ns=3, width=320, height=240, encoding=encoding
    )


def shot(mime: str, payload: bytes, encoding: str | None = "bgr8") -> Shot:
    return Shot("vision/front/x", mime, payload, header(encoding))


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
    assert encoded(shot(mime, payload), output, 90) == payload


def test_a_jpeg_saved_as_png_has_the_pixels_that_were_decoded():
    assert np.array_equal(seen(encoded(shot(JPEG, STILL), "a.png", 90)), seen(STILL))


def test_a_png_saved_as_jpeg_looks_the_same():
    file = encoded(shot(PNG, png(COLOUR)), "a.jpg", 95)
    assert file.startswith(b"\xff\xd8")
    assert np.abs(seen(file).astype(int) - COLOUR).mean() < 2


@pytest.mark.parametrize(
    ("encoding", "pixels", "expected"),
    [
        ("bgr8", COLOUR, COLOUR),
        ("rgb8", COLOUR[:, :, ::-1], COLOUR),
        ("mono8", COLOUR[:, :, 1], COLOUR[:, :, 1]),
        ("mono16", DEEP, DEEP),
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
    assert np.array_equal(seen(encoded(shot(RAW_IMAGE, raw, encoding), output, 90)), expected)


def test_raw_pixels_become_a_jpeg():
    file = encoded(shot(RAW_IMAGE, COLOUR.tobytes()), "a.jpg", 95)
    assert np.abs(seen(file).astype(int) - COLOUR).mean() < 2


@pytest.mark.parametrize(
    ("mime", "payload", "encoding"),
    [(PNG, png(DEEP), "mono16"), (RAW_IMAGE, DEEP.tobytes(), "mono16"), (PNG, png(DEEP), None)],
    ids=["PNG", "raw", "PNG without a word in the header"],
)
def test_16_bits_do_not_go_into_a_jpeg_and_the_way_out_is_named(mime, payload, encoding):
    with pytest.raises(ConfigurationError) as caught:
        encoded(shot(mime, payload, encoding), "folder/a.jpg", 90)
    assert str(caught.value).endswith("which a JPEG cannot hold: -o folder/a.png")


def test_a_picture_without_a_header_is_saved_all_the_same():
    bare = Shot("vision/front/x", JPEG, STILL, None)
    assert encoded(bare, "a.jpg", 90) == STILL
    assert np.array_equal(seen(encoded(bare, "a.png", 90)), seen(STILL))


@pytest.mark.parametrize(
    "broken",
    [
        shot(JPEG, damaged(STILL)),
        shot(RAW_IMAGE, b"123"),
        shot(RAW_IMAGE, COLOUR.tobytes(), "yuv422"),
        Shot("vision/front/x", RAW_IMAGE, COLOUR.tobytes(), None),
    ],
    ids=["damaged", "wrong size", "unknown encoding", "raw without a header"],
)
def test_what_cannot_be_decoded_is_named(broken):
    with pytest.raises(ExpectationNotMet, match="vision/front/x: "):
        encoded(broken, "a.png", 90)
