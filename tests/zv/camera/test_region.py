"""The part of a picture that a camera publishes: always what a slice of the whole picture shows."""

from __future__ import annotations

import logging
from contextlib import nullcontext

import cv2
import numpy as np
import pytest

from tests.support.pictures.encoded import jpeg, scene
from zenoh_vision.config.revisions import ParameterStore, Revision
from zenoh_vision.errors import ParameterRefused, PayloadError
from zenoh_vision.image.pixel_formats import Pixels
from zenoh_vision.image.planar import PlanarPicture
from zenoh_vision.messages import Header, Track
from zv.camera.convert import Converter
from zv.camera.delivery import Delivery
from zv.camera.reader import CapturedFrame
from zv.camera.region import check_region, cropped
from zv.camera.settings import CameraSettings
from zv.camera.sources.base import Picture, picture_of
from zv.camera.stream_limit import StreamLimit

BOX = (40, 30, 96, 64)
PART = (slice(30, 94), slice(40, 136))
"""Rows and columns of it."""
WHOLE = np.random.default_rng(5).integers(0, 256, (240, 320, 3), np.uint8)
FLIPPED = {
    "none": WHOLE,
    "horizontal": WHOLE[:, ::-1],
    "vertical": WHOLE[::-1],
    "both": WHOLE[::-1, ::-1],
}


def published(picture: Picture, box: tuple[int, int, int, int], flip: str = "none") -> Pixels:
    """Return the pixels that the camera publishes of a picture."""
    part = cropped(picture, box, flip)
    header = Header(
        camera="front", seq=0, epoch=1, stamp_ns=0, width=part.width, height=part.height
    ).model_copy(update={"encoding": part.encoding})
    return Converter().frame(header, part, flip=flip, quality=80).pixels


def planes(blurred: np.ndarray) -> PlanarPicture:
    """Return a picture as a video decoder delivers it, by OpenCV's conversion."""
    height, width = blurred.shape[:2]
    flat = cv2.cvtColor(blurred, cv2.COLOR_BGR2YUV_I420)
    chroma = flat[height:].reshape(2, height // 2, width // 2)
    bgr = cv2.cvtColor(flat, cv2.COLOR_YUV2BGR_I420)
    return PlanarPicture(
        (np.ascontiguousarray(flat[:height]), chroma[0], chroma[1]),
        full_range=False,
        to_bgr=lambda: np.asarray(bgr, np.uint8),
    )


@pytest.mark.parametrize("flip", FLIPPED)
def test_the_pixels_are_those_of_the_whole_flipped_picture(flip: str):
    assert np.array_equal(published(picture_of(WHOLE), BOX, flip), FLIPPED[flip][PART])


@pytest.mark.parametrize(
    ("encoding", "dtype"), [("mono8", np.uint8), ("mono16", np.uint16), ("32FC1", np.float32)]
)
def test_grey_and_depth_keep_their_values(encoding: str, dtype: type):
    grey = (WHOLE[:, :, 0].astype(dtype) * 3).astype(dtype)
    picture = Picture(encoding, 320, 240, pixels=grey)
    assert np.array_equal(published(picture, BOX), grey[PART])


def test_a_jpeg_is_decoded_and_the_part_of_it_is_published():
    packet = jpeg(scene(4))
    expected = cv2.imdecode(np.frombuffer(packet, np.uint8), cv2.IMREAD_COLOR)[PART]
    assert np.array_equal(published(Picture("bgr8", 320, 240, jpeg=packet), BOX), expected)


@pytest.mark.parametrize("box", [BOX, (41, 31, 95, 63)], ids=["even", "odd"])
@pytest.mark.parametrize("flip", ["none", "both"])
def test_a_videos_picture_shows_the_part_as_pixels_and_as_jpeg(box, flip: str):
    whole = planes(scene(4))
    x, y, width, height = box
    expected = whole.bgr()[::-1, ::-1] if flip == "both" else whole.bgr()
    expected = expected[y : y + height, x : x + width]
    part = cropped(Picture("bgr8", 320, 240, stored=whole), box, flip)
    header = Header(
        camera="front", seq=0, epoch=1, stamp_ns=0, width=width, height=height, encoding="bgr8"
    )
    frame = Converter().frame(header, part, flip=flip, quality=95)
    shown = cv2.imdecode(np.frombuffer(frame.compressed, np.uint8), cv2.IMREAD_COLOR)
    assert np.array_equal(frame.pixels, expected)
    assert np.abs(shown.astype(int) - expected).mean() < 2
    assert (part.stored is not None) is (box == BOX)


def test_the_truth_is_in_pixels_of_the_region_and_only_what_is_seen_in_it():
    inside = Track(id=1, state="confirmed", x=60, y=50, box=(50, 40, 20, 20), area=300)
    cut = Track(id=2, state="confirmed", x=40, y=50, box=(20, 40, 40, 20), area=400, vx=7)
    outside = Track(id=3, state="confirmed", x=10, y=10, box=(0, 0, 40, 30), area=900)
    picture = Picture("bgr8", 320, 240, pixels=WHOLE, truth=(inside, cut, outside))
    assert cropped(picture, BOX, "none").truth == (
        inside.model_copy(update={"x": 20.0, "y": 20.0, "box": (10, 10, 20, 20)}),
        cut.model_copy(update={"x": 10.0, "y": 20.0, "box": (0, 10, 20, 20), "area": 200.0}),
    )


@pytest.mark.parametrize("box", [(0, 0, 320, 240), (300, 239, 20, 1)])
def test_a_region_may_reach_to_the_edge(box):
    check_region(box, 320, 240)
    assert np.array_equal(published(picture_of(WHOLE), box), WHOLE[box[1] :, box[0] :])


@pytest.mark.parametrize("box", [(1, 0, 320, 240), (0, 1, 320, 240), (320, 0, 1, 1)])
def test_a_region_that_reaches_out_of_the_picture_is_refused_with_the_reason(box):
    text = ",".join(map(str, box))
    with pytest.raises(ParameterRefused) as refused:
        check_region(box, 320, 240)
    assert refused.value.error == f"region = {text} is not within the picture of 320x240"
    assert refused.value.allowed == "X + WIDTH at most 320, Y + HEIGHT at most 240"
    with pytest.raises(PayloadError) as dropped:
        cropped(picture_of(WHOLE), box, "none")
    assert dropped.value.reason == "region_outside"


@pytest.mark.parametrize("text", ["0,0,0,10", "0,0,10,0", "-1,0,10,10", "1,2,3", "0,0,10.5,10"])
def test_no_size_and_other_forms_are_refused(text: str):
    with pytest.raises(ValueError, match="region"):
        CameraSettings(region=text)


def test_a_region_of_the_synthetic_scene_is_within_its_size_at_all_times():
    store = ParameterStore(CameraSettings(region="600,400,40,80"))
    with pytest.raises(ParameterRefused, match="not within the picture of 639x480"):
        store.change({"width": 639})
    store.change({"width": 639, "region": ""})


def captured(settings: CameraSettings, width: int, height: int) -> CapturedFrame:
    picture = picture_of(np.zeros((height, width, 3), np.uint8))
    return CapturedFrame(picture, 1, 0, 0, Revision(0, settings))


def test_what_a_source_delivers_decides_and_later_changes_of_it_refuse_nothing_else(caplog):
    caplog.set_level(logging.INFO)
    delivery = Delivery("device", logging.getLogger("camera"))
    plain = CameraSettings(source="0")
    outside, inside = (
        plain.model_copy(update={"region": text}) for text in ("300,0,21,10", "300,0,20,10")
    )
    delivery.check(outside)  # nothing is known yet
    delivery.note(captured(plain, 320, 240))
    with pytest.raises(ParameterRefused):
        delivery.check(outside)
    delivery.check(inside)
    delivery.note(captured(inside, 320, 240))
    delivery.note(captured(inside, 160, 120))
    delivery.check(inside.model_copy(update={"quality": 50}))
    with pytest.raises(ParameterRefused):
        Delivery("device", logging.getLogger("camera")).note(captured(outside, 320, 240))
    assert caplog.messages == ["published from now on: region 300,0,20,10 of 320x240"]


LARGE, SMALL = {"width": 1280, "height": 720}, {"width": 320, "height": 240}
NEW_SIZE = {
    "fits the new size only": ({**LARGE, "region": "700,0,200,200"}, True, False),
    "fits the old size only": (SMALL, False, True),
    "fits neither": ({**LARGE, "region": "1200,0,81,10"}, False, False),
    "the device decides": ({"width": 1280, "region": "700,0,200,200"}, True, False),
    "no new size": ({"region": "700,0,200,200"}, False, False),
    "has gone": ({**SMALL, "region": ""}, True, True),
}
"""What is set, and whether it fits a device and a video, which keeps its size."""


@pytest.mark.parametrize(("change", "device", "video"), NEW_SIZE.values(), ids=NEW_SIZE)
def test_a_region_is_checked_against_the_size_that_a_device_is_opened_with_then(
    change: dict[str, object], device: bool, video: bool
):
    settings = CameraSettings(source="0", width=640, height=480, region="600,0,40,40")
    for kind, fits in (("device", device), ("video", video)):
        delivery = Delivery(kind, logging.getLogger("camera"))
        delivery.note(captured(settings, 640, 480))
        with nullcontext() if fits else pytest.raises(ParameterRefused, match="not within"):
            delivery.check(settings.model_copy(update=change))


def test_the_limit_of_bandwidth_makes_the_region_smaller_not_the_whole_picture():
    settings = CameraSettings(source="0", max_kbps=10, region="40,30,96,64")
    limit = StreamLimit()
    sizes = set()
    for number in range(100):
        part = cropped(picture_of(WHOLE), BOX, "none")
        frame = CapturedFrame(part, 1, number, 0, Revision(0, settings))
        fitted, quality = limit.fit(frame, number / 10)
        header = Header(
            camera="front", seq=number, epoch=1, stamp_ns=0, width=fitted.width,
            height=fitted.height, encoding="bgr8",
        )  # fmt: skip
        limit.may_send(Converter().frame(header, fitted, flip="none", quality=quality))
        sizes.add((fitted.width, fitted.height))
    assert sizes == {(96, 64), (48, 32), (24, 16)}
