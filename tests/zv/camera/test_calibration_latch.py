"""The camera's calibration follows its frames, and is published once for each kind of them."""

from __future__ import annotations

import pytest

from zenoh_vision.calibration.calibration import Calibration
from zenoh_vision.calibration.camera_model import CalibrationFault, CameraModel
from zenoh_vision.messages import CameraInfo, Header
from zv.camera.calibration_latch import CalibrationLatch
from zv.camera.geometry import Geometry

LENS = CameraModel(640, 480, (500.0, 0, 300, 0, 480, 250, 0, 0, 1), "plumb_bob", (0.0,) * 5)
WHOLE = Geometry()
PART = Geometry("none", (0, 0, 200, 160))


def told(
    latch: CalibrationLatch,
    geometry: Geometry = WHOLE,
    source: tuple[int, int] = (640, 480),
    epoch: int = 1,
) -> CameraInfo | None:
    width, height = source if geometry.box is None else geometry.box[2:]
    header = Header(camera="front", epoch=epoch, seq=0, stamp_ns=1, width=width, height=height)
    return latch.follow(header, geometry, source)


def test_it_is_told_once_and_again_after_each_change():
    latch = CalibrationLatch(Calibration(LENS), Geometry())
    kinds = [
        (WHOLE, (640, 480), 1),
        (WHOLE, (320, 240), 1),
        (Geometry("both"), (320, 240), 1),
        (Geometry("both"), (320, 240), 2),
        (PART, (640, 480), 2),
        (Geometry("none", (1, 0, 200, 160)), (640, 480), 2),
    ]
    messages = [told(latch, *kind) for kind in kinds for _ in range(3)]
    assert [message is not None for message in messages] == [True, False, False] * 6
    assert [each.k[2] for each in messages[::3]] == [300, 149.75, 169.25, 169.25, 300, 299]
    assert (messages[3].width, messages[12].width) == (320, 200)


def test_another_shape_is_refused_once_and_a_right_one_is_told_again():
    latch = CalibrationLatch(Calibration(LENS), Geometry())
    with pytest.raises(CalibrationFault, match=r"640x360; allowed: 640x480 of the calibration"):
        told(latch, source=(640, 360))
    assert told(latch, source=(640, 360)) is None
    assert told(latch, source=(640, 360), epoch=2) is None, "a video that is played again"
    assert told(latch, epoch=2) is not None
    with pytest.raises(CalibrationFault):
        told(latch, source=(640, 360), epoch=3)


@pytest.mark.parametrize(
    ("start", "flip", "center"),
    [
        ("none", "horizontal", (339, 250)),
        ("none", "vertical", (300, 229)),
        ("horizontal", "vertical", (339, 229)),
        ("both", "both", (300, 250)),
    ],
)
def test_it_holds_for_the_flip_of_the_start(start: str, flip: str, center: tuple[int, int]):
    message = told(CalibrationLatch(Calibration(LENS), Geometry(start)), Geometry(flip))
    assert (message.k[2], message.k[5]) == center


@pytest.mark.parametrize(
    ("start", "now", "center"),
    [
        (Geometry(), Geometry(rotate=90), (229, 300)),  # 480 - 1 - 250; the picture is 480x640
        (Geometry(), Geometry(rotate=180), (339, 229)),
        (Geometry(), Geometry(rotate=270), (250, 339)),  # 640 - 1 - 300
        (Geometry(rotate=180), Geometry(), (339, 229)),
        (Geometry("horizontal", rotate=180), Geometry("horizontal", rotate=180), (300, 250)),
    ],
)
def test_it_holds_for_the_rotation_of_the_start(
    start: Geometry, now: Geometry, center: tuple[int, int]
):
    message = told(CalibrationLatch(Calibration(LENS), start), now)
    assert (message.k[2], message.k[5]) == center


def test_a_calibration_of_upright_pictures_fits_a_camera_that_lies_on_its_side():
    upright = CameraModel(480, 640, (500.0, 0, 200, 0, 510, 330, 0, 0, 1), "plumb_bob", (0.0,) * 5)
    turned = Geometry("vertical", rotate=90)
    latch = CalibrationLatch(Calibration(upright), turned)
    message = told(latch, turned)  # of a source of 640x480
    assert (message.width, message.height) == (480, 640)
    assert message.k == pytest.approx(upright.k)
    # Without the rotation, columns of the source are what rows were.
    message = told(latch, Geometry())
    assert (message.width, message.height) == (640, 480)
    assert (message.k[0], message.k[4]) == (510, 500)
