"""Frames are chosen by a rate; pictures and calibrations change alike, by known lenses."""

from __future__ import annotations

import random
from itertools import pairwise
from typing import Any

import numpy as np
import pytest

from tests.support.headers import header
from zenoh_vision.calibration.calibration import Calibration
from zenoh_vision.calibration.camera_model import CameraModel, DistortionModel
from zenoh_vision.calibration.plane import Plane
from zenoh_vision.errors import ParameterRefused
from zenoh_vision.image import codecs
from zenoh_vision.image.frame import Frame
from zv.relay import transform as transform_module
from zv.relay.service import scaled
from zv.relay.transform import RateLimit, Transform, Transformer, calibration_after

SIZE = (320, 240)
K = (250.0, 0.0, 165.0, 0.0, 248.0, 118.0, 0.0, 0.0, 1.0)
P = (230.0, 0.0, 160.0, 0.0, 0.0, 231.0, 122.0, 0.0, 0.0, 0.0, 1.0, 0.0)
LENSES: dict[DistortionModel, tuple[float, ...]] = {
    "plumb_bob": (-0.25, 0.08, 0.001, -0.0008, 0.0),
    "equidistant": (-0.05, 0.02, -0.01, 0.002),
}
PLANE = Plane((0.01, 0.001, -1.0, 0.0005, 0.012, -2.0, 0.00001, 0.0004, 1.0))


def calibration(model: DistortionModel) -> Calibration:
    return Calibration(CameraModel(*SIZE, K, model, LENSES[model]), "front", p=P, plane=PLANE)


def spots(places: np.ndarray) -> np.ndarray:
    """Return a picture with a bright spot at each place, x, y."""
    y, x = np.mgrid[: SIZE[1], : SIZE[0]]
    levels = [np.exp(-((x - px) ** 2 + (y - py) ** 2) / 8) for px, py in places]
    return np.asarray(255 * np.max(levels, axis=0), np.uint8)


def centre(picture: np.ndarray, near: tuple[float, float]) -> tuple[float, float]:
    """Return the centre of the spot near a place."""
    x0, y0 = (round(each) - 8 for each in near)
    part = picture[max(0, y0) : y0 + 17, max(0, x0) : x0 + 17].astype(float)
    y, x = np.mgrid[: part.shape[0], : part.shape[1]]
    weight = np.where(part > 60, part, 0)
    total = weight.sum()
    return max(0, x0) + (x * weight).sum() / total, max(0, y0) + (y * weight).sum() / total


@pytest.mark.parametrize("model", sorted(LENSES))
def test_what_the_lens_bent_is_where_the_projection_says(model: DistortionModel):
    known = calibration(model)
    # Rays, where the lens shows them, and where a camera with the matrix P would.
    rays = np.array([(-0.4, -0.3), (0.35, -0.25), (0.0, 0.0), (-0.3, 0.32), (0.38, 0.3)])
    ideal = rays * (250, 248) + (165, 118)
    bent = known.camera.distorted(ideal)
    wanted = rays * (230, 231) + (160, 122)
    found = Transformer().rectified(spots(bent), known)
    for place in wanted:
        assert centre(found, place) == pytest.approx(tuple(place), abs=0.5)
    assert np.abs(bent - wanted).max() > 5, "otherwise the test shows nothing"


def test_a_calibration_is_scaled_once_for_all_frames_of_a_size():
    once = scaled(calibration("plumb_bob"), 160, 120)
    assert scaled(calibration("plumb_bob"), 160, 120) is once
    assert once == calibration("plumb_bob").scaled(160, 120)
    assert scaled(calibration("plumb_bob"), 80, 60) == calibration("plumb_bob").scaled(80, 60)


def test_equal_calibrations_share_their_maps(monkeypatch: pytest.MonkeyPatch):
    made: list[Calibration] = []
    original = transform_module._maps

    def counted(known: Calibration) -> Any:
        made.append(known)
        return original(known)

    monkeypatch.setattr(transform_module, "_maps", counted)
    transformer = Transformer()
    pixels = np.zeros((120, 160), np.uint8)
    for _frame in range(3):
        transformer.rectified(pixels, calibration("plumb_bob").scaled(160, 120))
    assert len(made) == 1
    transformer.rectified(pixels, calibration("equidistant").scaled(160, 120))
    assert len(made) == 2


@pytest.mark.parametrize("box", [None, (40, 30, 200, 160)])
@pytest.mark.parametrize("model", sorted(LENSES))
def test_the_calibration_of_the_result_shows_the_same_world(model: DistortionModel, box):
    known = calibration(model)
    transform = Transform(known, box)
    after = calibration_after(known, transform)
    assert after.camera.d == ()
    assert (after.camera.width, after.camera.height) == (SIZE if box is None else box[2:])
    rays = np.array([(-0.2, -0.1), (0.1, 0.15), (0.0, 0.0)])
    bent = known.camera.distorted(rays * (250, 248) + (165, 118))
    flat = rays * (230, 231) + (160, 122)
    if box is not None:
        flat = flat - box[:2]
    assert known.view is not None
    assert after.view is not None
    for (x, y), (u, v) in zip(bent, flat, strict=True):
        assert after.view.position(u, v) == pytest.approx(known.view.position(x, y), rel=1e-3)


def frame(pixels: np.ndarray) -> Frame:
    height, width = pixels.shape[:2]
    about = header(1, width=width, height=height, encoding="mono8")
    return Frame(about, codecs.encode_jpeg(pixels, "mono8", 95))


def test_scaling_keeps_the_coordinates_and_a_crop_has_its_own():
    pixels = spots(np.array([(100, 80)]))
    picture, size = Transformer().apply(frame(pixels), Transform(scale=0.5))
    assert (picture.size, size) == ((160, 120), SIZE)
    picture, size = Transformer().apply(frame(pixels), Transform(box=(60, 50, 100, 80), scale=0.5))
    assert (picture.size, size) == ((50, 40), (100, 80))
    whole, _ = Transformer().apply(frame(pixels), Transform(box=(60, 50, 100, 80)))
    assert centre(whole.pixels, (40, 30)) == pytest.approx((40, 30), abs=0.3)


def test_a_picture_that_nothing_changes_is_passed_on_undecoded():
    given = frame(spots(np.array([(100, 80)])))
    picture, _ = Transformer().apply(given, Transform())
    assert picture is given.picture


def test_a_region_outside_of_the_picture_is_refused_with_both_sizes():
    with pytest.raises(ParameterRefused, match="300,0,30,10 is not within the picture of 320x240"):
        Transformer().apply(frame(spots(np.array([(1, 1)]))), Transform(box=(300, 0, 30, 10)))


def passed(rate_hz: float | None, source_hz: float, count: int, jitter_s: float = 0.0) -> list[int]:
    """Return the numbers of the frames that pass."""
    limit, rng = RateLimit(), random.Random(3)
    stamps = [10**12 + int(1e9 * (n / source_hz + rng.uniform(0, jitter_s))) for n in range(count)]
    frames = [header(n, epoch=5, stamp_ns=stamp) for n, stamp in enumerate(stamps)]
    return [frame.seq for frame in frames if limit.allow(frame, rate_hz)]


@pytest.mark.parametrize(
    ("rate_hz", "source_hz", "numbers"),
    [
        (None, 30, [0, 1, 2, 3, 4, 5, 6]),
        (10, 30, [0, 3, 6]),
        (30, 30, [0, 1, 2, 3, 4, 5, 6]),
        (20, 30, [0, 2, 3, 5, 6]),  # of periods of 50 ms: 0, 67, 100, 167, 200
        (100, 30, [0, 1, 2, 3, 4, 5, 6]),
    ],
)
def test_frames_pass_at_the_rate_that_is_wanted(rate_hz, source_hz, numbers):
    assert passed(rate_hz, source_hz, 7) == numbers


def test_the_rate_is_kept_although_stamps_are_uneven():
    found = passed(5, 30, 900, jitter_s=0.02)
    assert 140 < len(found) <= 151
    assert all(b - a <= 8 for a, b in pairwise(found))


def test_a_pause_a_new_epoch_and_a_clock_set_back_begin_anew():
    limit = RateLimit()

    def allow(epoch: int, at_s: float) -> bool:
        return limit.allow(header(0, epoch=epoch, stamp_ns=int(at_s * 1e9)), 1.0)

    assert [allow(1, 100), allow(1, 100.5), allow(1, 130), allow(1, 130.5)] == [
        True,
        False,
        True,
        False,
    ]
    assert allow(2, 130.6)
    assert allow(2, 20)


def test_a_higher_rate_holds_at_once():
    limit = RateLimit()
    assert limit.allow(header(0, epoch=1, stamp_ns=10**12), 0.01)
    assert not limit.allow(header(1, epoch=1, stamp_ns=10**12 + 10**9), 0.01)
    assert limit.allow(header(2, epoch=1, stamp_ns=10**12 + 2 * 10**9), 10)
