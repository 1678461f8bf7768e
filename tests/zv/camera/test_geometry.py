"""What a frame shows of a source's picture: pixels, objects and calibration at the same place."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
import pytest

from tests.support.pictures.encoded import jpeg, scene
from zenoh_vision.calibration.calibration import Calibration
from zenoh_vision.calibration.camera_model import CameraModel
from zenoh_vision.calibration.plane import Plane
from zenoh_vision.config.revisions import ParameterStore
from zenoh_vision.errors import ParameterRefused, PayloadError
from zenoh_vision.image.picture import JpegPicture, PixelPicture, picture_of
from zenoh_vision.image.planar import PlanarPicture
from zenoh_vision.messages import Track
from zv.camera.geometry import Geometry
from zv.camera.settings import CameraSettings

BOX = (40, 30, 96, 64)
PART = (slice(30, 94), slice(40, 136))
"""Rows and columns of it."""
SIZE = (320, 240)
WHOLE = np.random.default_rng(5).integers(0, 256, (240, 320, 3), np.uint8)
FLIPS: dict[str, Any] = {
    "none": lambda pixels: pixels,
    "horizontal": lambda pixels: pixels[:, ::-1],
    "vertical": lambda pixels: pixels[::-1],
    "both": lambda pixels: pixels[::-1, ::-1],
}


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


def track(box: tuple[int, int, int, int], **fields: object) -> Track:
    x, y, width, height = box
    center = {"x": float(x + int(width / 2)), "y": float(y + int(height / 2))}
    return Track.model_validate({"id": 1, "state": "confirmed", "box": box, **center, **fields})


@pytest.mark.parametrize(
    ("encoding", "dtype"), [("mono8", np.uint8), ("mono16", np.uint16), ("32FC1", np.float32)]
)
def test_grey_and_depth_keep_their_values(encoding: str, dtype: type):
    grey = (WHOLE[:, :, 0].astype(dtype) * 3).astype(dtype)
    shown = Geometry("none", BOX).picture(PixelPicture(grey, encoding), encoding)
    assert np.array_equal(shown.pixels, grey[PART])


def test_a_jpeg_is_decoded_and_the_part_of_it_is_published():
    packet = jpeg(scene(4))
    expected = cv2.imdecode(np.frombuffer(packet, np.uint8), cv2.IMREAD_COLOR)[PART]
    shown = Geometry("none", BOX).picture(JpegPicture(packet), "bgr8")
    assert np.array_equal(shown.pixels, expected)


@pytest.mark.parametrize("box", [BOX, (41, 31, 95, 63)], ids=["even", "odd"])
@pytest.mark.parametrize("flip", ["none", "both"])
def test_a_videos_picture_shows_the_part_as_pixels_and_as_jpeg(box, flip: str):
    whole = planes(scene(4))
    x, y, width, height = box
    expected = FLIPS[flip](whole.pixels)[y : y + height, x : x + width]
    part = Geometry(flip, box).picture(whole, "bgr8")
    shown = cv2.imdecode(np.frombuffer(part.jpeg(95), np.uint8), cv2.IMREAD_COLOR)
    assert np.array_equal(part.pixels, expected)
    assert np.abs(shown.astype(int) - expected).mean() < 2
    assert isinstance(part, PlanarPicture) is (box == BOX and flip == "none")


def test_the_truth_is_in_pixels_of_the_region_and_only_what_is_seen_in_it():
    inside, cut, outside = (
        track((50, 40, 20, 20), area=300),
        track((20, 40, 40, 20), area=400, vx=7),
        track((0, 0, 40, 30), area=900),
    )
    assert Geometry("none", BOX).tracks((inside, cut, outside), SIZE) == (
        track((10, 10, 20, 20), area=300),
        track((0, 10, 20, 20), area=200, vx=7),
    )
    # Of the flipped picture, only the last one is within its lower right corner.
    corner = Geometry("both", (280, 200, 40, 40))
    assert corner.tracks((inside, cut, outside), SIZE) == (track((0, 10, 40, 30), area=900),)


def test_without_a_step_the_truth_stays_as_it_is():
    odd = Track(id=1, state="confirmed", x=1.5, y=2.5, box=(1, 2, 3, 4), area=5.0)
    assert Geometry().tracks((odd,), (64, 48)) == (odd,)


@pytest.mark.parametrize("box", [(0, 0, 320, 240), (300, 239, 20, 1)])
def test_a_region_may_reach_to_the_edge(box):
    geometry = Geometry("none", box)
    geometry.check(SIZE)
    shown = geometry.picture(PixelPicture(WHOLE), "bgr8").pixels
    assert np.array_equal(shown, WHOLE[box[1] :, box[0] :])


@pytest.mark.parametrize("box", [(1, 0, 320, 240), (0, 1, 320, 240), (320, 0, 1, 1)])
def test_a_region_that_reaches_out_of_the_picture_is_refused_with_the_reason(box):
    text = ",".join(map(str, box))
    with pytest.raises(ParameterRefused) as refused:
        Geometry("none", box).check(SIZE)
    assert refused.value.error == f"region = {text} is not within the picture of 320x240"
    assert refused.value.allowed == "X + WIDTH at most 320, Y + HEIGHT at most 240"
    with pytest.raises(PayloadError) as dropped:
        Geometry("none", box).picture(PixelPicture(WHOLE), "bgr8")
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


LENS = CameraModel(
    640, 480, (500.0, 0, 300, 0, 480, 250, 0, 0, 1), "plumb_bob", (-0.2, 0.05, 0.003, -0.002, 0.01)
)
BELT = Calibration(LENS, "front", plane=Plane((1, 0, 0, 0, 0, 1000, 0, 1, 100)))


@pytest.mark.parametrize("flip", FLIPS)
@pytest.mark.parametrize("box", [None, (100, 50, 200, 160)])
@pytest.mark.parametrize("divisor", [1, 2])
def test_a_place_on_the_belt_stays_the_same(
    flip: str, box: tuple[int, int, int, int] | None, divisor: int
):
    size = (640 // divisor, 480 // divisor)
    seen = Geometry(flip, box).calibration(BELT, size)
    assert (seen.camera.width, seen.camera.height) == (box or (0, 0, *size))[2:]
    points = np.array([(130.0, 60.0), (299.0, 209.0), (180.0, 70.0)])
    # A pixel's centre is at a whole number, so its left edge is at -0.5.
    shown = (points + 0.5) / divisor - 0.5
    if flip in ("horizontal", "both"):
        shown[:, 0] = size[0] - 1 - shown[:, 0]
    if flip in ("vertical", "both"):
        shown[:, 1] = size[1] - 1 - shown[:, 1]
    shown -= (box or (0, 0))[:2]
    np.testing.assert_allclose(seen.view.positions(shown), BELT.view.positions(points), rtol=1e-6)


def test_the_principal_point_is_mirrored_and_moved():
    assert Geometry("horizontal").calibration(BELT, (640, 480)).p[2] == 339
    part = Geometry("horizontal", (100, 50, 200, 160)).calibration(BELT, (640, 480))
    assert part.camera.k == (500, 0, 239, 0, 480, 200, 0, 0, 1)


def test_the_projection_of_a_region_has_its_principal_point_there():
    """Also that of a stereo camera, whose fourth column is the distance to the other one."""
    p = (500.0, 0, 300, -50, 0, 480, 250, 20, 0, 0, 1, 0.5)
    part = Geometry("none", (100, 50, 200, 160)).calibration(
        Calibration(LENS, "front", p=p), (640, 480)
    )
    assert part.p == (500, 0, 200, -100, 0, 480, 200, -5, 0, 0, 1, 0.5)
    assert part.camera.k == (500, 0, 200, 0, 480, 200, 0, 0, 1)


TURNS: dict[int, Any] = {
    0: lambda pixels: pixels,
    90: lambda pixels: np.rot90(pixels, -1),
    180: lambda pixels: np.rot90(pixels, 2),
    270: lambda pixels: np.rot90(pixels, 1),
}
TALL_BOX = (40, 30, 96, 250)
"""Within the picture of 240x320 that one of 320x240 becomes, and not within the other."""


@pytest.mark.parametrize("box", [None, (10, 30, 96, 64)], ids=["whole", "region"])
@pytest.mark.parametrize("flip", FLIPS)
@pytest.mark.parametrize("rotate", TURNS)
def test_the_picture_is_rotated_clockwise_then_flipped_then_cut_out(
    rotate: int, flip: str, box: tuple[int, int, int, int] | None
):
    expected = FLIPS[flip](TURNS[rotate](WHOLE))
    if box is not None:
        expected = expected[box[1] : box[1] + box[3], box[0] : box[0] + box[2]]
    geometry = Geometry(flip, box, rotate)
    assert np.array_equal(geometry.picture(PixelPicture(WHOLE), "bgr8").pixels, expected)
    packet = cv2.imencode(".png", WHOLE)[1].tobytes()
    assert np.array_equal(geometry.picture(picture_of(packet), "bgr8").pixels, expected)


@pytest.mark.parametrize("flip", FLIPS)
@pytest.mark.parametrize("rotate", TURNS)
@pytest.mark.parametrize("box", [(3, 5, 10, 7), (0, 0, 64, 48), (63, 47, 1, 1), (20, 8, 11, 12)])
def test_the_truth_turns_with_the_picture(rotate: int, flip: str, box: tuple[int, int, int, int]):
    left, top, width, height = box
    painted = np.zeros((48, 64), np.uint8)
    painted[top : top + height, left : left + width] = 255
    geometry, seen = Geometry(flip, None, rotate), track(box, area=70.0)
    (found,) = geometry.tracks((seen,), (64, 48))
    shown = geometry.picture(PixelPicture(painted), "mono8").pixels
    place = tuple(cv2.boundingRect(np.ascontiguousarray(shown)))  # of what is white, by OpenCV
    assert found == track(place, area=70.0)  # type: ignore[arg-type]
    # A thing that moves by (8, -5) in a second moves in the turned picture as its pixels do.
    here, there = (
        geometry.tracks((track(place, area=1.0, vx=8.0, vy=-5.0),), (64, 48))[0]
        for place in ((20, 20, 4, 4), (28, 15, 4, 4))
    )
    moved = (there.box[0] - here.box[0], there.box[1] - here.box[1])
    assert (here.vx, here.vy) == moved


def test_a_region_is_judged_by_the_size_of_the_rotated_picture():
    Geometry("none", TALL_BOX, 90).check(SIZE)
    with pytest.raises(ParameterRefused, match="not within the picture of 320x240"):
        Geometry("none", TALL_BOX).check(SIZE)
    with pytest.raises(ParameterRefused, match="not within the picture of 240x320"):
        Geometry("none", (200, 0, 96, 64), 270).check(SIZE)


@pytest.mark.parametrize("flip", FLIPS)
@pytest.mark.parametrize("rotate", TURNS)
def test_a_point_of_the_world_is_where_the_turned_picture_shows_it(rotate: int, flip: str):
    k = np.array([[300.0, 0, 150], [0, 320, 130], [0, 0, 1]])
    d = (0.1, -0.05, 0.01, -0.02, 0.003)
    lens = CameraModel(320, 240, tuple(k.ravel()), "plumb_bob", d)
    geometry = Geometry(flip, (10, 20, 200, 160), rotate)
    turned = geometry.calibration(Calibration(lens), SIZE)
    axes = {0: np.eye(2), 90: [[0, -1], [1, 0]], 180: -np.eye(2), 270: [[0, 1], [-1, 0]]}[rotate]
    mirror = np.diag(
        {"none": (1, 1), "horizontal": (-1, 1), "vertical": (1, -1)}.get(flip, (-1, -1))
    )
    to_turned = np.eye(3)
    to_turned[:2, :2] = mirror @ np.asarray(axes)
    points = np.random.default_rng(1).uniform((-0.3, -0.2, 1), (0.3, 0.2, 2), (20, 3))
    none = np.zeros(3)
    seen = cv2.projectPoints(points, none, none, k, np.array(d))[0].reshape(-1, 2)
    again = cv2.projectPoints(
        points @ to_turned.T, none, none, turned.camera.matrix, np.array(turned.camera.d)
    )[0].reshape(-1, 2)
    for (x, y), (u, v) in zip(seen, again, strict=True):
        pixel = track((0, 0, 1, 1), area=1.0).model_copy(update={"box": (int(x), int(y), 1, 1)})
        left, top, _, _ = Geometry(flip, None, rotate).tracks((pixel,), SIZE)[0].box
        assert abs(u + 10 - left) < 1.01
        assert abs(v + 20 - top) < 1.01
    # Exactly, by the corners: pixel centres map onto pixel centres.
    wide, high = geometry.turn.size(SIZE)
    corner = np.array([wide - 1, high - 1]) / 2 - (10, 20)
    middle = np.linalg.inv(k) @ (159.5, 119.5, 1)
    assert turned.camera.matrix @ to_turned @ middle == pytest.approx((*corner, 1))
