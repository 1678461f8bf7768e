"""Settings are checked against what the source delivers."""

from __future__ import annotations

import logging
from contextlib import nullcontext

import numpy as np
import pytest

from zenoh_vision.config.revisions import Revision
from zenoh_vision.errors import ParameterRefused
from zenoh_vision.image.picture import JpegPicture, PixelPicture
from zv.camera.delivery import Delivery
from zv.camera.reader import CapturedFrame
from zv.camera.settings import CameraSettings

LOG = logging.getLogger("camera")


def captured(settings: CameraSettings, width: int, height: int, dtype: type = np.uint8):
    picture = PixelPicture(np.zeros((height, width), dtype))
    return CapturedFrame(picture, None, 1, 0, 0, Revision(0, settings))


def test_what_a_source_delivers_decides_and_later_changes_of_it_refuse_nothing_else(caplog):
    caplog.set_level(logging.INFO)
    delivery = Delivery("device", LOG)
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
        Delivery("device", LOG).note(captured(outside, 320, 240))
    assert caplog.messages == ["published from now on: region 300,0,20,10 of 320x240"]


def test_that_jpegs_are_no_longer_passed_on_is_logged(caplog):
    caplog.set_level(logging.INFO)
    settings = CameraSettings(source="0", region="0,0,10,10")
    jpeg = JpegPicture(b"", size=(320, 240))
    Delivery("device", LOG).note(CapturedFrame(jpeg, None, 1, 0, 0, Revision(0, settings)))
    assert caplog.messages == [
        "published from now on: region 0,0,10,10 of 320x240; its JPEGs are encoded again"
    ]


@pytest.mark.parametrize(("dtype", "allowed"), [(np.uint8, False), (np.uint16, True)])
def test_depth_is_only_published_of_16_bits_and_losing_them_is_logged(caplog, dtype, allowed: bool):
    settings = CameraSettings(source="0")
    delivery = Delivery("device", LOG)
    delivery.note(captured(settings, 320, 240, dtype))
    assert ("--encoding mono16 keeps them" in caplog.text) is allowed
    with nullcontext() if allowed else pytest.raises(ParameterRefused, match="16UC1 is depth"):
        delivery.check(settings.model_copy(update={"encoding": "16UC1"}))


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
        delivery = Delivery(kind, LOG)
        delivery.note(captured(settings, 640, 480))
        with nullcontext() if fits else pytest.raises(ParameterRefused, match="not within"):
            delivery.check(settings.model_copy(update=change))


def test_a_region_that_shows_another_part_since_the_picture_was_turned_is_said():
    delivery = Delivery("device", LOG)
    still = CameraSettings(source="0", region="80,60,160,120")
    delivery.note(captured(still, 640, 480))
    assert not delivery.moved
    turned = still.model_copy(update={"rotate": 90})
    delivery.note(captured(turned, 640, 480))
    # The picture is now 480x640: x = 480 - 60 - 120, y = 80.
    assert delivery.moved == (
        "region = 80,60,160,120 shows another part of the scene, since the picture was rotated by "
        "90 degrees; set region = 300,80,120,160 for the part before"
    )
    delivery.note(captured(turned.model_copy(update={"region": "300,80,120,160"}), 640, 480))
    assert not delivery.moved
    delivery.note(captured(still.model_copy(update={"region": "300,80,120,160"}), 640, 480))
    assert "set region = 80,60,160,120" in delivery.moved
    delivery.note(captured(turned.model_copy(update={"region": ""}), 640, 480))
    assert not delivery.moved
