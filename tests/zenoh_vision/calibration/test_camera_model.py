"""The lens: distortion as ROS defines it, and its removal."""

from __future__ import annotations

import math

import numpy as np
import pytest

from zenoh_vision.calibration.camera_model import CalibrationFault, CameraModel, model_named

K = (500.0, 0.0, 319.5, 0.0, 480.0, 239.5, 0.0, 0.0, 1.0)
GRID = np.array([(x, y) for x in range(0, 640, 71) for y in range(0, 480, 53)], float)
MODELS = {
    "plumb_bob": (-0.28, 0.09, 0.0012, -0.0007, -0.01),
    "rational_polynomial": (0.4, -0.2, 0.001, -0.0005, 0.02, 0.7, -0.1, 0.03),
    "equidistant": (-0.05, 0.02, -0.01, 0.002),
}


def by_the_formula(model: str, d: tuple[float, ...], pixel: np.ndarray) -> tuple[float, float]:
    """Distort one pixel by the formulas in the documentation of sensor_msgs/CameraInfo."""
    x, y = (pixel[0] - K[2]) / K[0], (pixel[1] - K[5]) / K[4]
    r2 = x * x + y * y
    if model == "equidistant":
        r = math.sqrt(r2)
        theta = math.atan(r)
        bent = theta * (1 + sum(k * theta ** (2 * n) for n, k in enumerate(d, 1)))
        factor = bent / r if r else 1.0
        return K[0] * x * factor + K[2], K[4] * y * factor + K[5]
    k1, k2, p1, p2, k3, *rest = d
    k4, k5, k6 = rest or (0, 0, 0)
    radial = (1 + k1 * r2 + k2 * r2**2 + k3 * r2**3) / (1 + k4 * r2 + k5 * r2**2 + k6 * r2**3)
    u = x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x)
    v = y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y
    return K[0] * u + K[2], K[4] * v + K[5]


@pytest.mark.parametrize("model", sorted(MODELS))
def test_distortion_follows_the_formula_of_its_model_and_is_removed(model: str):
    camera = CameraModel(640, 480, K, model_named(model), MODELS[model])
    shown = np.array([by_the_formula(model, MODELS[model], pixel) for pixel in GRID])
    np.testing.assert_allclose(camera.distorted(GRID), shown, atol=1e-6)
    np.testing.assert_allclose(camera.undistorted(shown), GRID, atol=1e-4)


def test_without_coefficients_points_stay_where_they_are():
    assert (CameraModel(640, 480, K).undistorted(GRID) == GRID).all()


def test_a_pixel_that_the_lens_cannot_show_has_no_ideal_place():
    """r (1 - 0.3 r^2) is at most 0.703, at r = 1.054: nothing is shown farther out than 351 px."""
    camera = CameraModel(640, 480, K, "plumb_bob", (-0.3, 0.0, 0.0, 0.0))
    inside, outside = camera.undistorted(np.array([(319.5 + 340, 239.5), (319.5 + 380, 239.5)]))
    assert np.isfinite(inside).all()
    assert np.isnan(outside).all()
    assert camera.undistorted(np.empty((0, 2))).shape == (0, 2)


@pytest.mark.parametrize(
    ("wrong", "says"),
    [
        ({"width": 0}, "width: 0; allowed: 1 to 65535"),
        ({"k": K[:8]}, "k: 8 numbers; allowed: 9"),
        ({"k": (0.0, *K[1:])}, "fx and fy above 0"),
        ({"k": (500.0, 1.0, *K[2:])}, "fx, 0, cx"),
        ({"k": (math.nan, *K[1:])}, "allowed: finite numbers"),
        ({"d": (0.1,)}, "d: 1 numbers; allowed: 0 or 4 or 5 for plumb_bob"),
        ({"d": (0.1, 0, 0, math.inf)}, "d: .*inf.*; allowed: finite numbers"),
    ],
)
def test_impossible_values_are_refused(wrong: dict, says: str):
    with pytest.raises(CalibrationFault, match=says):
        CameraModel(**{"width": 640, "height": 480, "k": K} | wrong)


def test_a_model_that_is_not_known_is_refused_naming_those_that_are():
    with pytest.raises(CalibrationFault, match="plumb_bob, rational_polynomial, equidistant"):
        model_named("thin_prism")
    assert model_named("fisheye") == "equidistant"
