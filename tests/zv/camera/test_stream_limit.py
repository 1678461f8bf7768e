"""The pictures that a camera with a budget publishes."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from tests.support.headers import header
from tests.support.pictures.encoded import jpeg, scene
from zenoh_vision.config.revisions import Revision
from zenoh_vision.errors import PayloadError
from zenoh_vision.image import codecs
from zenoh_vision.image.frame import Frame
from zenoh_vision.image.pixel_formats import DEEP
from zenoh_vision.messages import Track
from zv.camera.convert import Converter
from zv.camera.reader import CapturedFrame
from zv.camera.settings import CameraSettings
from zv.camera.sources.base import Picture
from zv.camera.stream_limit import StreamLimit, reduced

NOISE = np.random.default_rng(1).integers(0, 256, (480, 640, 3), np.uint8)
"""About 290 kB at quality 80 and 110 kB at 30: far over 100 kbit/s at any quality."""
CALM = jpeg(scene(0))


class Camera:
    """The path of a picture in the camera, without a network; someone subscribes."""

    def __init__(self, **settings: Any) -> None:
        self.settings = CameraSettings(**settings)
        self.limit = StreamLimit()
        self._converter = Converter()
        self._seq = 0

    def publish(self, picture: Picture, epoch: int = 1) -> tuple[Frame, bool]:
        """Return the frame of a picture, 0.1 s after the last, and whether it was sent."""
        settings = self.settings
        captured = CapturedFrame(picture, epoch, self._seq, 0, Revision(0, settings))
        fitted, quality = self.limit.fit(captured, self._seq / 10)
        size = {"width": fitted.width, "height": fitted.height}
        sent = header(self._seq, epoch, encoding=settings.encoding, **size)
        self._seq += 1
        frame = self._converter.frame(sent, fitted, flip=settings.flip, quality=quality)
        return frame, self.limit.may_send(frame)

    def settle(self, picture: Picture, times: int = 100) -> list[tuple[Frame, bool]]:
        """Publish a picture for ten seconds, or so many times."""
        return [self.publish(picture) for _ in range(times)]


def noise() -> Picture:
    return Picture("bgr8", 640, 480, pixels=NOISE)


def test_without_a_budget_pictures_are_left_alone():
    camera, picture = Camera(quality=70), noise()
    frame, sent = camera.publish(picture)
    assert sent
    assert np.shares_memory(frame.pixels, NOISE)
    assert codecs.encode_jpeg(NOISE, "bgr8", 70) == frame.compressed
    assert camera.limit.words == ""


def test_pictures_shrink_to_a_quarter_with_a_header_of_their_own_size():
    camera = Camera(max_kbps=100)
    frame, _ = camera.settle(noise())[-1]
    assert (frame.header.width, frame.header.height) == (160, 120)
    assert codecs.picture_size(frame.compressed) == (160, 120)
    assert frame.pixels.shape == (120, 160, 3)
    blocks = NOISE.reshape(120, 4, 160, 4, 3).mean((1, 3))
    assert np.abs(blocks - frame.pixels).max() <= 1, "each pixel is the mean of those it covers"
    assert camera.limit.words == (
        "max_kbps = 100: quality 30 instead of 80, a quarter of each side, fewer frames"
    )


def test_what_is_sent_stays_within_the_budget():
    camera = Camera(max_kbps=400)
    frames = camera.settle(noise()) + camera.settle(noise())
    sent = [frame for frame, is_sent in frames[50:] if is_sent]
    assert sum(len(frame.compressed) for frame in sent) <= 400 * 125 * 15 * 1.05
    assert len(sent) > 75


@pytest.mark.parametrize("encoding", sorted(DEEP))
def test_lossless_pictures_keep_size_and_values_and_lose_only_rate(encoding: str):
    camera = Camera(max_kbps=100, encoding=encoding)
    depth = np.random.default_rng(1).integers(0, 2**16, (48, 64), np.uint16)
    frames = camera.settle(Picture("mono16", 64, 48, pixels=depth))
    assert {frame.pixels.shape for frame, _ in frames} == {(48, 64)}
    values = codecs.decode_deep_png(frames[-1][0].compressed)
    expected = frames[-1][0].depth
    assert np.array_equal(values, expected)
    # PNGs of 6.2 kB of noise, with headers 6.5 kB: 12.5 kB a second are not quite two of them.
    assert 17 <= sum(sent for _, sent in frames) <= 20
    assert camera.limit.words == "max_kbps = 100: fewer frames"


def test_a_jpeg_of_the_source_passes_on_unless_it_is_over_the_budget():
    picture = Picture("bgr8", 320, 240, jpeg=CALM)
    needed_kbps = len(CALM) * 10 * 8 // 1000
    rich, poor = Camera(max_kbps=2 * needed_kbps), Camera(max_kbps=needed_kbps // 2)
    assert all(sent and frame.compressed is CALM for frame, sent in rich.settle(picture))
    assert rich.limit.words == ""
    frames = poor.settle(picture)
    assert not any(frame.compressed is CALM for frame, _ in frames[10:])
    assert frames[-1][0].header.width == 320, "at a lower quality it fits"
    assert "quality" in poor.limit.words


def test_a_jpeg_with_flaws_is_made_smaller_too():
    flawed = CALM[:-2] + b"\x55" * 20 + CALM[-2:]
    with pytest.raises(PayloadError):
        codecs.decode_jpeg(flawed, "bgr8")
    camera = Camera(max_kbps=40)
    frames = camera.settle(Picture("bgr8", 320, 240, jpeg=flawed))
    sent = sum(len(frame.compressed) for frame, is_sent in frames[30:] if is_sent)
    assert 0 < sent <= 40 * 125 * 7 * 1.1


def test_after_one_jpeg_with_flaws_the_clean_ones_of_its_epoch_are_not_passed_on_beside_the_plan():
    flawed = CALM[:-2] + b"\x55" * 20 + CALM[-2:]
    camera = Camera(max_kbps=40)
    camera.settle(Picture("bgr8", 320, 240, jpeg=flawed), 1)
    frames = camera.settle(Picture("bgr8", 320, 240, jpeg=CALM))
    assert not any(frame.compressed is CALM for frame, _ in frames)
    sizes = [frame.header.width for frame, _ in frames]
    assert sizes == sorted(sizes, reverse=True)


def test_ground_truth_is_that_of_the_smaller_picture():
    track = Track(
        id=1, state="confirmed", x=300, y=200, box=(280, 180, 40, 40), area=1600, vx=80, vy=-40
    )
    picture = Picture("bgr8", 640, 480, pixels=NOISE, truth=(track,))
    (half,) = reduced(picture, 2).truth or ()
    assert (half.x, half.y, half.box, half.area) == (150, 100, (140, 90, 20, 20), 400)
    assert (half.vx, half.vy, half.id) == (40, -20, 1)


def test_an_odd_side_is_rounded_to_a_size_of_the_same_shape():
    picture = Picture("mono8", 67, 51, pixels=np.zeros((51, 67), np.uint8))
    small = reduced(picture, 4)
    assert (small.width, small.height) == (17, 13)
    assert small.pixels is not None
    assert small.pixels.shape == (13, 17)


def test_a_budget_that_is_lifted_brings_the_picture_back_at_once():
    camera = Camera(max_kbps=100)
    camera.settle(noise())
    camera.settings = CameraSettings()
    frame, sent = camera.publish(noise())
    assert sent
    assert frame.header.width == 640
    assert camera.limit.words == ""


def test_replies_to_queries_are_charged_only_while_there_is_a_budget():
    camera = Camera()
    camera.publish(noise())
    assert camera.limit.may_reply(10_000_000) == ""
    camera = Camera(max_kbps=100)
    camera.publish(noise())
    assert camera.limit.may_reply(1_000_000) == ""
    # 1,050,300 bytes take 84 s at 100 kbit/s, and 168 s in the half that replies have.
    assert camera.limit.may_reply(1) == (
        "max_kbps = 100 is used up by earlier replies; ask again in 168.0 s"
    )
    _, sent = camera.publish(noise())
    assert not sent
