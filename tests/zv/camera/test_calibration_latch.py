"""The camera's calibration follows its pictures, and is published once for each kind of them."""

from __future__ import annotations

import numpy as np
import pytest

from zenoh_vision.calibration.calibration import Calibration
from zenoh_vision.calibration.camera_model import CalibrationFault, CameraModel
from zenoh_vision.calibration.plane import Plane
from zenoh_vision.messages import Header
from zv.camera.calibration_latch import CalibrationLatch

LENS = CameraModel(
    640, 480, (500.0, 0, 300, 0, 480, 250, 0, 0, 1), "plumb_bob", (-0.2, 0.05, 0.003, -0.002, 0.01)
)
BELT = Calibration(LENS, "front", plane=Plane((1, 0, 0, 0, 0, 1000, 0, 1, 100)))


def header(width: int = 640, height: int = 480, epoch: int = 1, seq: int = 0) -> Header:
    return Header(camera="front", epoch=epoch, seq=seq, stamp_ns=1, width=width, height=height)


def test_it_is_told_once_and_again_after_a_change():
    latch = CalibrationLatch(BELT, "none")
    kinds = [
        (header(), "none"),
        (header(seq=1), "none"),
        (header(320, 240, seq=2), "none"),
        (header(320, 240, seq=3), "both"),
        (header(320, 240, seq=4), "both"),
        (header(320, 240, epoch=2), "both"),
    ]
    told = [latch.follow(*kind) for kind in kinds]
    assert [message is not None for message in told] == [True, False, True, True, False, True]
    assert (told[2].width, told[2].k[0]) == (320, 250)


def test_another_shape_is_refused_once_and_a_right_one_is_told_again():
    latch = CalibrationLatch(BELT, "none")
    with pytest.raises(CalibrationFault, match=r"640x360; allowed: 640x480 of the calibration"):
        latch.follow(header(640, 360), "none")
    assert latch.follow(header(640, 360, seq=1), "none") is None
    assert latch.follow(header(seq=2), "none") is not None


@pytest.mark.parametrize(
    ("start", "flip", "sideways", "upside_down"),
    [
        ("none", "horizontal", True, False),
        ("none", "vertical", False, True),
        ("horizontal", "vertical", True, True),
        ("both", "both", False, False),
    ],
)
def test_a_place_on_the_belt_stays_the_same_in_the_mirrored_picture(
    start: str, flip: str, sideways: bool, upside_down: bool
):
    message = CalibrationLatch(BELT, start).follow(header(), flip)
    points = np.array([(30.0, 40.0), (600.0, 400.0), (320.0, 100.0)])
    mirrored = points.copy()
    if sideways:
        mirrored[:, 0] = 639 - points[:, 0]
    if upside_down:
        mirrored[:, 1] = 479 - points[:, 1]
    view = Calibration.of_message(message).view
    np.testing.assert_allclose(view.positions(mirrored), BELT.view.positions(points), rtol=1e-6)
    if sideways and not upside_down:
        assert message.p[2] == message.k[2] == 339


@pytest.mark.parametrize("flip", ["none", "both"])
@pytest.mark.parametrize("divisor", [1, 2])
def test_a_place_on_the_belt_stays_the_same_in_a_region(flip: str, divisor: int):
    """Pixel (x, y) of the picture is (x - 100, y - 50) of a region whose corner is there."""
    box = (100, 50, 200, 160)
    whole = Calibration.of_message(CalibrationLatch(BELT, "none").follow(header(), flip)).view
    message = CalibrationLatch(BELT, "none").follow(
        header(200 // divisor, 160 // divisor), flip, (640, 480), box
    )
    part = Calibration.of_message(message).view
    points = np.array([(120.0, 60.0), (299.0, 209.0), (180.0, 70.0)])
    # A pixel's centre is at a whole number, so its left edge is at -0.5.
    seen = (points - (100, 50) + 0.5) / divisor - 0.5
    np.testing.assert_allclose(part.positions(seen), whole.positions(points), rtol=1e-9)
    assert (message.width, message.height) == (200 // divisor, 160 // divisor)


def test_the_projection_of_a_region_has_its_principal_point_there():
    """Also that of a stereo camera, whose fourth column is the distance to the other one."""
    p = (500.0, 0, 300, -50, 0, 480, 250, 20, 0, 0, 1, 0.5)
    part = Calibration(LENS, "front", p=p).cropped(100, 50, 200, 160)
    assert part.p == (500, 0, 200, -100, 0, 480, 200, -5, 0, 0, 1, 0.5)
    assert part.camera.k == (500, 0, 200, 0, 480, 200, 0, 0, 1)


def test_a_narrow_region_may_be_made_smaller():
    """A quarter of 18 pixels is rounded to 4, which is no other shape."""
    message = CalibrationLatch(BELT, "none").follow(
        header(4, 100), "none", (640, 480), (0, 0, 18, 400)
    )
    assert (message.width, message.height) == (4, 100)


def test_another_region_publishes_it_again():
    latch = CalibrationLatch(BELT, "none")
    boxes = [None, (0, 0, 200, 160), (0, 0, 200, 160), (1, 0, 200, 160), None]
    sizes = [(640, 480), (200, 160), (200, 160), (200, 160), (640, 480)]
    told = [
        latch.follow(header(*size), "none", (640, 480), box)
        for box, size in zip(boxes, sizes, strict=True)
    ]
    assert [message is not None for message in told] == [True, True, False, True, True]
