"""JPEGs in bands: the same pictures as in one piece, for any decoder and any number of threads."""

from __future__ import annotations

import random
from collections.abc import Iterator

import cv2
import numpy as np
import pytest
import simplejpeg

from tests.support.pictures.videos import decoded
from zenoh_vision.errors import PayloadError
from zenoh_vision.host.parallel import workers
from zenoh_vision.image import bands, codecs
from zenoh_vision.image.planar import PlanarPicture

RESTART_INTERVAL = b"\xff\xdd\x00\x04"
SIZES = [(768, 576), (801, 611), (640, 480), (1921, 333)]


@pytest.fixture(autouse=True)
def four_threads_for_small_pictures(monkeypatch) -> Iterator[None]:
    monkeypatch.setattr(bands, "BAND_PIXELS", 40_000)
    workers.limit(4)
    yield
    workers.limit(0)


def scene(width: int, height: int) -> np.ndarray:
    """Return a picture whose colours change from row to row."""
    rng = np.random.default_rng(5)
    small = rng.integers(0, 256, (height // 8 + 1, width // 8 + 1, 3), np.uint8)
    large = cv2.resize(small, (width, height), interpolation=cv2.INTER_CUBIC)
    return np.asarray(cv2.add(large, rng.integers(0, 8, large.shape, np.uint8)))


def planes_of(width: int, height: int) -> PlanarPicture:
    yuv = cv2.cvtColor(scene(width, height), cv2.COLOR_BGR2YUV_I420)
    half, chroma = (height // 2, width // 2), yuv[height:].reshape(2, -1)
    planes = yuv[:height], chroma[0].reshape(half), chroma[1].reshape(half)
    blank = np.zeros((height, width, 3), np.uint8)
    return PlanarPicture(planes, full_range=True, to_bgr=lambda: blank)


def in_one_piece(width: int, height: int, encoding: str = "bgr8") -> bytes:
    workers.limit(1)
    jpeg = codecs.encode_jpeg(pixels_of(width, height, encoding), encoding, 80)
    workers.limit(4)
    assert RESTART_INTERVAL not in jpeg
    return jpeg


def pixels_of(width: int, height: int, encoding: str) -> np.ndarray:
    pixels = scene(width, height)
    return np.ascontiguousarray(pixels[:, :, 1]) if encoding == "mono8" else pixels


@pytest.mark.parametrize("encoding", ["bgr8", "mono8"])
@pytest.mark.parametrize(("width", "height"), SIZES)
@pytest.mark.parametrize("number", [2, 3, 8])
def test_another_decoder_sees_no_difference_to_one_piece(width, height, number, encoding):
    whole = in_one_piece(width, height, encoding)
    workers.limit(number)
    divided = codecs.encode_jpeg(pixels_of(width, height, encoding), encoding, 80)
    assert divided.count(RESTART_INTERVAL) == 1
    assert np.array_equal(decoded(divided), decoded(whole))
    assert abs(len(divided) - len(whole)) < 64 * number


def test_planes_are_divided_like_pixels():
    picture = planes_of(768, 576)
    divided = picture.jpeg(80)
    workers.limit(1)
    whole = picture.jpeg(80)
    assert RESTART_INTERVAL in divided
    assert RESTART_INTERVAL not in whole
    assert np.array_equal(decoded(divided), decoded(whole))


@pytest.mark.parametrize(("width", "height"), SIZES)
def test_the_pixels_are_those_of_one_piece_but_for_the_smoothed_chroma_at_the_borders(
    width, height
):
    divided = codecs.encode_jpeg(scene(width, height), "bgr8", 80)
    layout = bands.layout(divided)
    assert layout is not None
    whole = simplejpeg.decode_jpeg(divided, "BGR").astype(int)
    difference = np.abs(codecs.decode_jpeg(divided, "bgr8") - whole).max(axis=(1, 2))
    borders = range(layout.rows, height, layout.rows)
    assert set(np.flatnonzero(difference)) <= {row for top in borders for row in (top - 1, top)}
    assert 0 < difference.max() < 40  # each band was decoded by itself
    gray = simplejpeg.decode_jpeg(divided, "GRAY")[:, :, 0]
    assert np.array_equal(codecs.decode_jpeg(divided, "mono8"), gray)


@pytest.mark.parametrize("encoding", ["bgr8", "rgba8", "mono8"])
def test_the_pixels_do_not_depend_on_the_number_of_threads(encoding):
    divided = codecs.encode_jpeg(scene(801, 611), "bgr8", 80)
    found = codecs.decode_jpeg(divided, encoding)
    for number in (1, 2, 8):
        workers.limit(number)
        assert np.array_equal(codecs.decode_jpeg(divided, encoding), found)


def test_pixels_are_decoded_into_given_memory():
    divided = codecs.encode_jpeg(scene(801, 611), "bgr8", 80)
    memory = np.zeros(801 * 611 * 3, np.uint8)
    codecs.decode_jpeg(divided, "bgr8", target=memory)
    assert np.array_equal(memory.reshape(611, 801, 3), codecs.decode_jpeg(divided, "bgr8"))


@pytest.mark.parametrize(
    ("size", "interval", "rows"),
    [
        ((800, 608), 50 * 19, 304),
        ((800, 608), 50 * 10, 160),
        ((800, 608), 50 * 4, None),  # ten bands
        ((800, 608), 75, None),  # not whole rows
        ((160, 128), 10 * 4, None),  # too small to be worth it
    ],
)
def test_restart_markers_of_another_encoder_make_bands_if_they_are_so(size, interval, rows):
    options = [cv2.IMWRITE_JPEG_RST_INTERVAL, interval]
    jpeg = cv2.imencode(".jpg", scene(*size), options)[1].tobytes()
    layout = bands.layout(jpeg)
    assert (layout and layout.rows) == rows
    gray = simplejpeg.decode_jpeg(jpeg, "GRAY")[:, :, 0]
    assert np.array_equal(codecs.decode_jpeg(jpeg, "mono8"), gray)


@pytest.mark.parametrize(
    ("width", "height", "encoded", "decoded"),
    [
        (640, 480, 1, 1),
        (800, 500, 1, 1),
        (768, 576, 2, 1),
        (1280, 720, 2, 2),
        (1920, 1080, 4, 4),
        (3840, 2160, 4, 4),
    ],
)
def test_the_larger_a_picture_is_the_more_bands_it_has_but_no_more_than_threads(
    width, height, encoded, decoded, monkeypatch
):
    monkeypatch.undo()
    jpeg = codecs.encode_jpeg(scene(width, height), "bgr8", 80)
    assert sum(jpeg.count(bytes((0xFF, 0xD0 + number))) for number in range(8)) == encoded - 1
    layout = bands.layout(jpeg)
    assert (1 if layout is None else -(-height // layout.rows)) == decoded


@pytest.mark.parametrize(
    ("width", "height", "encoding", "number"),
    [
        (7680, 4320, "bgr8", 2),  # 129,600 MCUs
        (7680, 4320, "mono8", 8),  # 518,400
        (65_500, 144, "mono8", 3),  # 8188 in a row
        (65_500, 144, "mono8", 2),
    ],
)
def test_the_largest_pictures_have_no_more_mcus_in_a_band_than_a_jpeg_can_state(
    width, height, encoding, number
):
    workers.limit(number)
    shape = (height, width) if encoding == "mono8" else (height, width, 3)
    jpeg = codecs.encode_jpeg(np.zeros(shape, np.uint8), encoding, 80)
    assert RESTART_INTERVAL in jpeg
    assert decoded(jpeg).shape == shape


def test_what_needs_more_bands_than_there_are_numbers_is_in_one_piece():
    jpeg = codecs.encode_jpeg(np.zeros((506, 65_500), np.uint8), "mono8", 80)  # 8 rows of MCUs each
    assert RESTART_INTERVAL in jpeg
    jpeg = codecs.encode_jpeg(np.zeros((520, 63_000), np.uint8), "mono8", 80)
    assert RESTART_INTERVAL not in jpeg
    assert decoded(jpeg).shape == (520, 63_000)


def test_a_side_that_no_jpeg_may_have_is_refused_as_in_one_piece():
    with pytest.raises(ValueError, match="65500"):
        codecs.encode_jpeg(np.zeros((65_520, 16), np.uint8), "mono8", 80)


@pytest.mark.parametrize(("least", "is_whole"), [((701, 100), True), ((700, 532), False)])
def test_a_size_that_only_full_scale_has_is_decoded_in_bands_too(least, is_whole):
    divided = codecs.encode_jpeg(scene(800, 608), "bgr8", 80)
    found = codecs.decode_jpeg(divided, "bgr8", least)
    if is_whole:
        assert np.array_equal(found, codecs.decode_jpeg(divided, "bgr8"))
    else:
        assert found.shape == (532, 700, 3)


def test_long_segments_before_the_coded_data_are_not_copied_for_each_band():
    divided = codecs.encode_jpeg(scene(800, 608), "bgr8", 80)
    comment = b"\xff\xfe\xff\xff" + bytes(65_533)
    assert bands.layout(divided[:2] + comment + divided[2:]) is None
    assert bands.layout(divided[:2] + comment[:2] + b"\x00\x10" + bytes(14) + divided[2:])


def damages(jpeg: bytes) -> dict[str, bytes]:
    first, second = jpeg.index(b"\xff\xd0"), jpeg.index(b"\xff\xd1")
    return {
        "cut short in the last band": jpeg[: second + 900],
        "without the end": jpeg[:-2],
        "without a band": jpeg[:first] + jpeg[second:],
        "without a marker": jpeg[:first] + jpeg[first + 2 :],
        "a band cut short": jpeg[: first - 500] + jpeg[first:],
        "bytes beyond a band": jpeg[:first] + bytes(500) + jpeg[first:],
        "markers exchanged": jpeg[:first] + b"\xff\xd1" + jpeg[first + 2 : second] + b"\xff\xd0"
        + jpeg[second + 2 :],
    }  # fmt: skip


@pytest.mark.parametrize("damage", damages(b"\xff\xd0" + bytes(999) + b"\xff\xd1"))
def test_damage_is_an_error_as_in_one_piece(damage):
    jpeg = damages(codecs.encode_jpeg(scene(800, 608), "bgr8", 80))[damage]
    with pytest.raises(ValueError, match=r".+"):
        simplejpeg.decode_jpeg(jpeg, "BGR")
    with pytest.raises(PayloadError) as caught:
        codecs.decode_jpeg(jpeg, "bgr8")
    assert caught.value.reason == "corrupt"


def test_a_damaged_head_is_never_more_than_an_error():
    jpeg = codecs.encode_jpeg(scene(800, 608), "bgr8", 80)
    layout = bands.layout(jpeg)
    assert layout is not None
    end, chance = layout.head.end, random.Random(3)
    for length in range(end):
        assert bands.layout(jpeg[:length]) is None
    for _ in range(3000):
        damaged = bytearray(jpeg[: end + 100])
        for _ in range(chance.choice((1, 1, 2, 5))):
            damaged[chance.randrange(end)] = chance.choice((0, 1, 0xFF, chance.randrange(256)))
        found = bands.layout(bytes(damaged))
        assert found is None or found.rows > 0
