"""Sizes and forms of pictures, without network or browser."""

import cv2
import numpy as np
import pytest

from tests.support.headers import header
from zenoh_vision.errors import PayloadError
from zenoh_vision.image import codecs, pixel_formats
from zenoh_vision.image.depth import RangeFinder, ValueRange
from zenoh_vision.image.frame import Frame
from zenoh_vision.image.picture import PixelPicture
from zv.viewer.streams.rendering import (
    EncodedPicture,
    RenderOptions,
    original,
    render,
    render_ended,
)


def frame(pixels: np.ndarray, encoding: str, mime: str | None = "image/jpeg") -> Frame:
    height, width = pixels.shape[:2]
    head = header(width=width, height=height, encoding=encoding)
    if mime is None:
        return Frame(head, pixels)
    if mime == "image/png":
        return Frame(head, codecs.encode_png(pixels))
    return Frame(head, codecs.encode_jpeg(pixels, encoding, 95))


def halves() -> np.ndarray:
    """A picture whose left half is blue and right half is red, 64x48."""
    pixels = np.zeros((48, 64, 3), np.uint8)
    pixels[:, :32, 0] = 255
    pixels[:, 32:, 2] = 255
    return pixels


@pytest.mark.parametrize(
    ("options", "size"),
    [
        (RenderOptions(), (640, 480)),
        (RenderOptions(320), (320, 240)),  # the shape is kept
        (RenderOptions(height=240), (320, 240)),
        (RenderOptions(100, 100), (100, 100)),  # stretched, as in ROS
        (RenderOptions(1280, 960), (1280, 960)),
        (RenderOptions(100, 100, fit=True), (100, 75)),  # 100 / 640 = 0.156; 480 * 0.156 = 75
        (RenderOptions(1280, 960, fit=True), (640, 480)),  # never enlarged
        (RenderOptions(width=64, fit=True), (64, 48)),
        (RenderOptions(1, 1, fit=True), (1, 1)),
        # 10240 x 7680 has too many pixels: of 9437184 in the shape 4:3, the height is
        # sqrt(9437184 * 3 / 4) = 2660.4 and the width 4 / 3 of it.
        (RenderOptions(height=7680), (3547, 2660)),
    ],
)
def test_the_size_follows_from_what_is_asked(options, size):
    assert options.size(640, 480) == size


@pytest.mark.parametrize(
    ("options", "mime", "left"),
    [
        (RenderOptions(), "image/jpeg", True),
        (RenderOptions(), "image/png", True),
        (RenderOptions(format="jpeg"), "image/jpeg", True),
        (RenderOptions(format="jpeg"), "image/png", False),
        (RenderOptions(format="png"), "image/jpeg", False),
        (RenderOptions(640, 480), "image/jpeg", True),
        (RenderOptions(9999, 9999, fit=True), "image/jpeg", True),
        (RenderOptions(320, 240), "image/jpeg", False),
        (RenderOptions(quality=80), "image/jpeg", False),
        (RenderOptions(quality=80), "image/png", True),
        (RenderOptions(invert=True), "image/jpeg", False),
    ],
)
def test_only_what_must_change_is_changed(options, mime, left):
    assert options.unchanged(mime, 640, 480) == left


def test_inverted_is_turned_by_180_degrees():
    picture = render(frame(halves(), "bgr8"), RenderOptions(32, invert=True), 90)
    assert (picture.mime, picture.width, picture.height) == ("image/jpeg", 32, 24)
    pixels = codecs.decode_jpeg(picture.payload, "bgr8")
    assert pixels.shape == (24, 32, 3)
    assert pixels[12, 4, 2] > 200 > 50 > pixels[12, 4, 0]  # red is on the left now


def test_sixteen_bits_become_eight_in_a_jpeg_and_stay_sixteen_in_a_png():
    depth = np.full((48, 64), 0x8080, np.uint16)  # 0x8080 / 257 = 128
    source = frame(depth, "mono16", "image/png")
    picture = render(source, RenderOptions(format="jpeg"), 95)
    assert picture.mime == "image/jpeg"
    assert abs(int(codecs.decode_jpeg(picture.payload, "mono8")[5, 5]) - 128) <= 1
    picture = render(source, RenderOptions(32), 95)
    assert picture.mime == "image/png"
    small = cv2.imdecode(np.frombuffer(picture.payload, np.uint8), cv2.IMREAD_UNCHANGED)
    assert (small.dtype, small.shape, small[5, 5]) == (np.uint16, (24, 32), 0x8080)


ROOM = np.repeat(np.array([[0, 2000, 2500, 3000]], np.uint16), 16, axis=1).repeat(48, axis=0)
"""64x48: a hole, then 2 m to 3 m, in millimetres."""

KINDS = pytest.mark.parametrize(
    ("encoding", "mime"),
    [("16UC1", "image/png"), ("16UC1", None), ("32FC1", None), ("bgr8", "image/png")],
    ids=["compressed", "raw", "raw metres", "bare"],
)


def room(encoding: str, mime: str | None) -> Frame:
    """Return the depth as a frame that arrived, compressed or raw, with an automatic range."""
    head = frame(ROOM, "mono16", "image/png").header.model_copy(update={"encoding": encoding})
    key = "vision/front/image/compressed" if mime else "vision/front/image"
    shown = codecs.encode_png(ROOM) if mime else pixel_formats.convert(ROOM, "16UC1", encoding)
    found = Frame(head, shown, key=key)
    found.find_range(RangeFinder())
    return found


def decoded(picture: EncodedPicture) -> np.ndarray:
    return cv2.imdecode(np.frombuffer(picture.payload, np.uint8), cv2.IMREAD_UNCHANGED)


@KINDS
def test_depth_is_grey_for_a_page_with_the_range_in_use(encoding, mime):
    options = RenderOptions(fit=True, depth="gray")
    assert original(room(encoding, mime), options) is None, "a browser would show it as black"
    picture = render(room(encoding, mime), options, 80)
    assert (picture.mime, picture.values, picture.packed) == (
        "image/png",
        ValueRange(2000, 3000),
        False,
    )
    found = decoded(picture)
    assert found.dtype == np.uint8
    assert found[20, [8, 24, 40, 56]].tolist() == [0, 1, 128, 255]
    small = render(room(encoding, mime), RenderOptions(32, fit=True, quality=90, depth="gray"), 80)
    assert (small.mime, small.width) == ("image/jpeg", 32)


@KINDS
def test_depth_with_values_is_exact_and_never_mixed(encoding, mime):
    for width, step in ((None, 16), (32, 8), (7, 7 / 4)):
        options = RenderOptions(width, fit=True, depth="values")
        picture = render(room(encoding, mime), options, 80)
        assert (picture.mime, picture.packed) == ("image/png", True)
        blue, green, red = (plane.astype(int) for plane in cv2.split(decoded(picture)))
        values = red * 256 + green
        assert set(values.ravel().tolist()) == {0, 2000, 2500, 3000}
        places = [int((part + 0.5) * step) for part in range(4)]
        assert values[0, places].tolist() == [0, 2000, 2500, 3000]
        assert blue[0, places].tolist() == [0, 1, 128, 255]


def test_programs_get_depth_as_it_is():
    source = room("16UC1", "image/png")
    for options in (RenderOptions(), RenderOptions(format="png")):
        found = original(source, options)
        assert found is not None
        assert found.payload == source.compressed
    jpeg = render(source, RenderOptions(format="jpeg"), 100)
    gray = codecs.decode_jpeg(jpeg.payload, "mono8").astype(int)
    assert np.abs(gray[20, [8, 24, 40, 56]] - [0, 1, 128, 255]).max() <= 3


def test_the_picture_of_ended_depth_is_grey_by_the_range_that_it_had():
    deep = render(room("16UC1", "image/png"), RenderOptions(32, format="png"), 80)
    assert decoded(deep).dtype == np.uint16
    ended = decoded(render_ended(deep, 1_790_000_000_000_000_000))
    assert ended[2, [4, 28]].tolist() == [0, 89]  # 255 * 0.35


@pytest.mark.parametrize("encoding", ["bgr8", "rgb8", "mono8", "bgra8"])
def test_raw_pixels_of_each_encoding_are_shown_in_their_colours(encoding):
    pixels = pixel_formats.convert(halves(), "bgr8", encoding)
    picture = render(frame(pixels, encoding, None), RenderOptions(), 95)
    assert (picture.mime, picture.width, picture.height) == ("image/jpeg", 64, 48)
    shown = codecs.decode_jpeg(picture.payload, "bgr8")[24, 10].astype(int)
    wanted = [29, 29, 29] if encoding == "mono8" else [255, 0, 0]  # luma of blue: 0.114 * 255
    assert np.abs(shown - wanted).max() < 12


def test_edges_as_jpeg_are_grey():
    edges = np.zeros((48, 64), np.uint8)
    edges[10] = 255
    picture = render(frame(edges, "mono8", "image/png"), RenderOptions(format="jpeg"), 95)
    assert picture.mime == "image/jpeg"
    assert codecs.decode_jpeg(picture.payload, "mono8")[10].min() > 230


def test_packed_bits_become_a_png_of_one_bit_and_only_on_a_render_thread():
    """``original`` is called on the event loop, so it must not encode."""
    edges = np.zeros((48, 64), np.uint8)
    edges[20] = 255
    header = frame(edges, "mono8").header
    bits = Frame(header, PixelPicture(edges, bilevel=True), key="vision/front/edges/compressed")
    assert original(bits, RenderOptions()) is None
    found = render(bits, RenderOptions(), 80)
    assert (found.mime, found.payload[24]) == ("image/png", 1)  # bit depth
    assert np.array_equal(decoded(found), edges)
    smaller = render(bits, RenderOptions(32), 80)
    assert 0 < decoded(smaller)[10, 0] < 255  # half of each pixel
    assert original(frame(edges, "mono8", "image/png"), RenderOptions()) is not None


def test_a_broken_picture_is_refused():
    good = frame(halves(), "bgr8")
    broken = Frame(good.header, good.compressed[:-40])
    with pytest.raises(PayloadError, match="corrupt"):
        render(broken, RenderOptions(32), 80)


@pytest.mark.parametrize("kind", ["jpeg", "png", "depth", "alpha"])
def test_the_picture_of_an_ended_stream_is_dim_grey_and_as_large(kind):
    white = np.full((240, 320, 3), 250, np.uint8)
    pictures = {
        "jpeg": lambda: codecs.encode_jpeg(white, "bgr8", 90),
        "png": lambda: codecs.encode_png(white),
        "depth": lambda: codecs.encode_png(np.full((240, 320), 64000, np.uint16)),
        "alpha": lambda: codecs.encode_png(np.full((240, 320, 4), 250, np.uint8)),
    }
    before = pictures[kind]()
    mime = "image/jpeg" if kind == "jpeg" else "image/png"
    encoding = "mono16" if kind == "depth" else "bgr8"
    head = frame(white, "bgr8", None).header.model_copy(update={"encoding": encoding})
    last = EncodedPicture("vision/front/image/compressed", head, before, mime, 320, 240)
    after = render_ended(last, 1_790_000_000_000_000_000).payload
    assert after[:3] == before[:3]
    pixels = cv2.imdecode(np.frombuffer(after, np.uint8), cv2.IMREAD_UNCHANGED)
    assert pixels.shape == (240, 320)
    assert 80 < np.median(pixels) < 95  # 250 * 0.35 = 87
    assert pixels.max() > 200  # the words
