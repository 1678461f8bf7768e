"""The compressed pictures that a camera with a budget sends; the frames keep their size."""

from __future__ import annotations

import logging

import numpy as np
import pytest

from tests.support.headers import header
from tests.support.pictures.encoded import jpeg, scene
from zenoh_vision.errors import PayloadError
from zenoh_vision.image import codecs
from zenoh_vision.image.frame import Frame
from zenoh_vision.image.picture import JpegPicture, Picture, PixelPicture
from zenoh_vision.image.pixel_formats import DEEP
from zv.camera.stream_limit import StreamLimit

NOISE = np.random.default_rng(1).integers(0, 256, (480, 640, 3), np.uint8)
"""About 290 kB at quality 80 and 110 kB at 30: far over 100 kbit/s at any quality."""
CALM = jpeg(scene(0))


class Camera:
    """The limit of a camera to whose compressed pictures someone subscribes."""

    def __init__(self, max_kbps: int | None) -> None:
        self.max_kbps = max_kbps
        self.now_s = 100.0
        self.limit = StreamLimit(lambda: self.max_kbps, lambda: self.now_s)

    def compress(self, picture: Picture, times: int = 1, quality: int = 80) -> list[bytes | None]:
        """Return what is sent for a picture that comes so many times, every 0.1 s."""
        found = []
        for _ in range(times):
            sent = header(width=picture.width, height=picture.height, encoding=picture.encoding)
            found.append(self.limit.compress(Frame(sent, picture, quality=quality)))
            self.now_s += 0.1
        return found


def bytes_of(sent: list[bytes | None]) -> list[int]:
    return [len(each) for each in sent if each is not None]


def calm() -> JpegPicture:
    return JpegPicture(CALM, strict=False)


def test_without_a_budget_pictures_have_the_quality_of_their_frames():
    camera = Camera(None)
    expected = codecs.encode_jpeg(NOISE, "bgr8", 70)
    assert camera.compress(PixelPicture(NOISE), quality=70) == [expected]
    assert camera.limit.words() == ""


def test_pictures_shrink_to_a_quarter_and_the_frame_does_not(caplog: pytest.LogCaptureFixture):
    caplog.set_level(logging.INFO)
    camera = Camera(100)
    sent = [each for each in camera.compress(PixelPicture(NOISE), 100) if each is not None]
    assert codecs.picture_size(sent[-1]) == (160, 120)
    blocks = NOISE.reshape(120, 4, 160, 4, 3).mean((1, 3))
    blocks = np.rint(blocks).astype(np.uint8)
    shown = codecs.decode_jpeg(codecs.encode_jpeg(blocks, "bgr8", 30), "bgr8")
    difference = shown.astype(int) - codecs.decode_jpeg(sent[-1], "bgr8")
    assert np.abs(difference).mean() < 1, "each pixel is the mean of those it covers"
    # It shows the same frame in the coordinates of the header.
    assert Frame(header(width=640, height=480), sent[-1]).pixels.shape == (480, 640, 3)
    assert camera.limit.words() == (
        "max_kbps = 100: quality 30 instead of 80, a quarter of each side, fewer frames"
    )
    assert "pictures have a quarter of each side from now on" in caplog.text


def test_an_odd_side_is_rounded_to_a_size_of_the_same_shape():
    sent = Camera(10).compress(PixelPicture(NOISE[:431, :571]))[0]
    assert codecs.picture_size(sent) == (143, 108)


def test_what_is_sent_stays_within_the_budget():
    camera = Camera(400)
    camera.compress(PixelPicture(NOISE), 50)
    sizes = bytes_of(camera.compress(PixelPicture(NOISE), 150))
    assert sum(sizes) <= 400 * 125 * 15 * 1.05
    assert len(sizes) > 75


@pytest.mark.parametrize("encoding", sorted(DEEP))
def test_lossless_pictures_keep_size_and_values_and_lose_only_rate(encoding: str):
    camera = Camera(100)
    depth = np.random.default_rng(1).integers(0, 2**16, (48, 64), np.uint16)
    sent = camera.compress(PixelPicture(depth, "mono16").turned("none", encoding), 100)
    pngs = [each for each in sent if each is not None]
    assert all(np.array_equal(codecs.decode_png(each), depth) for each in pngs)
    # PNGs of 6.2 kB of noise, with headers 6.5 kB: 12.5 kB a second are not quite two of them.
    assert 17 <= len(pngs) <= 20
    assert camera.limit.words() == "max_kbps = 100: fewer frames"


def test_a_jpeg_of_the_source_passes_on_unless_it_is_over_the_budget():
    needed_kbps = len(CALM) * 10 * 8 // 1000
    rich, poor = Camera(2 * needed_kbps), Camera(needed_kbps // 2)
    assert rich.compress(calm(), 100) == [CALM] * 100
    assert rich.limit.words() == ""
    sent = poor.compress(calm(), 100)
    assert CALM not in sent[10:]
    assert codecs.picture_size(sent[-1]) == (320, 240), "at a lower quality it fits"
    assert "quality" in poor.limit.words()


def test_a_jpeg_with_flaws_is_made_smaller_too():
    flawed = CALM[:-2] + b"\x55" * 20 + CALM[-2:]
    with pytest.raises(PayloadError):
        codecs.decode_jpeg(flawed, "bgr8")
    sizes = bytes_of(Camera(40).compress(JpegPicture(flawed, strict=False), 100)[30:])
    assert 0 < sum(sizes) <= 40 * 125 * 7 * 1.1


def test_a_budget_that_is_lifted_brings_the_picture_back_at_once():
    camera = Camera(100)
    camera.compress(PixelPicture(NOISE), 100)
    camera.max_kbps = None
    assert camera.compress(PixelPicture(NOISE)) == [codecs.encode_jpeg(NOISE, "bgr8", 80)]
    assert camera.limit.words() == ""


def test_nothing_is_said_of_pictures_that_nobody_gets_any_more():
    camera = Camera(100)
    camera.compress(PixelPicture(NOISE), 100)
    camera.now_s += 3.0
    assert camera.limit.words() == ""


def test_replies_to_queries_are_charged_only_while_there_is_a_budget():
    assert Camera(None).limit.may_reply(10_000_000) is None
    camera = Camera(100)
    camera.compress(calm())
    assert camera.limit.may_reply(1_000_000) is None
    # 1,050,300 bytes take 84 s at 100 kbit/s, and 168 s in the half that replies have.
    refusal = "max_kbps = 100 is used up by earlier replies; ask again in 168.0 s"
    camera.now_s -= 0.1
    assert camera.limit.may_reply(1) == refusal
    assert camera.compress(calm()) == [None]
