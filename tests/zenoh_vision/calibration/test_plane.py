"""The homography from pixels to a plane: found, measured, refused; and what follows from it."""

from __future__ import annotations

import numpy as np
import pytest

from zenoh_vision.calibration.calibration import Calibration
from zenoh_vision.calibration.camera_model import CalibrationFault, CameraModel
from zenoh_vision.calibration.plane import DegeneratePairs, Plane, fit_plane
from zenoh_vision.calibration.plane_view import PlaneView

K = (500.0, 0.0, 319.5, 0.0, 500.0, 239.5, 0.0, 0.0, 1.0)
BENT = CameraModel(640, 480, K, "plumb_bob", (-0.2, 0.05, 0.001, -0.001, 0.0))

# X = x / (y + 100), Y = 1000 / (y + 100): the horizon is at y = -100.
TILTED = Plane((1, 0, 0, 0, 0, 1000, 0, 1, 100))
PIXELS = np.array([(0, 0), (600, 0), (600, 400), (0, 400)], float)
LOW = PIXELS + np.array([0, 200])
WORLD = np.array([(0, 10), (6, 10), (1.2, 2), (0, 2)], float)


def test_the_homography_maps_pixels_as_its_formula_says():
    np.testing.assert_allclose(TILTED.world(PIXELS), WORLD)
    np.testing.assert_allclose(TILTED.pixels(WORLD), PIXELS, atol=1e-9)
    beyond = np.array([(5.0, -100.0), (5.0, -101.0)])  # or on the horizon
    assert np.isnan(TILTED.world(beyond)).all()


def test_four_pairs_determine_it():
    fit = fit_plane(PIXELS, WORLD)
    inside = np.array([(300.0, 25.0)])
    np.testing.assert_allclose(fit.plane.world(inside), [(300 / 125, 8)], rtol=1e-6)
    assert fit.rms < 1e-6


def test_the_horizon_may_lie_in_the_picture():
    """The third row is positive where the pairs are, even if it is negative at pixel (0, 0)."""
    lowered = fit_plane(LOW, WORLD).plane
    assert np.isnan(lowered.world(np.array([(0.0, 0.0)]))).all()
    np.testing.assert_allclose(lowered.world(LOW), WORLD, rtol=1e-6, atol=1e-6)


def test_an_error_in_a_pair_is_seen_in_the_residuals_of_many():
    pixels = np.array([(x, y) for x in (0, 200, 400, 600) for y in (0, 150, 300)], float)
    world = TILTED.world(pixels)
    world[5] += (0.3, 0.0)
    fit = fit_plane(pixels, world)
    assert fit.residuals.argmax() == 5
    assert 0.1 < fit.residuals[5] < 0.3


def test_the_accuracy_of_four_pairs_is_the_movement_for_one_pixel_at_each():
    """Where a pixel is 0.01 units and the pairs are far apart, it is 0.01 in x and in y: 0.0141."""
    square = np.array([(0, 0), (500, 0), (500, 500), (0, 500)], float)
    assert fit_plane(square, square / 100).per_pixel == pytest.approx(0.0141, rel=0.02)


@pytest.mark.parametrize(
    ("pixels", "world", "says"),
    [
        (PIXELS[:3], WORLD[:3], "3 pairs .* at least 4"),
        (PIXELS * (1, 0), WORLD, "on a line"),
        (np.array([(0, 0), (100, 0), (200, 0), (50, 80)]), WORLD, "on a line"),
        (np.array([(n, n) for n in range(6)]), np.array([(n, 2 * n) for n in range(6)]), "line"),
        (np.zeros((4, 2)), WORLD, "on a line"),
        (PIXELS, WORLD[[0, 1, 3, 2]], "contradict"),
        (PIXELS * np.nan, WORLD, "pixels is not finite"),
        (PIXELS, WORLD * 1e300, r"world is .* beyond 1e\+12"),
    ],
    ids=["three", "a line", "three of four on a line", "diagonal", "one", "swapped", "nan", "huge"],
)
def test_pairs_that_do_not_determine_a_plane_are_refused(
    pixels: np.ndarray, world: np.ndarray, says: str
):
    with pytest.raises(DegeneratePairs, match=says):
        fit_plane(np.asarray(pixels, float), np.asarray(world, float))


@pytest.mark.parametrize("h", [(0.0,) * 9, (1.0, 2, 3, 2, 4, 6, 7, 8, 9), (1.0,) * 8])
def test_a_homography_that_cannot_be_inverted_is_refused(h: tuple[float, ...]):
    with pytest.raises(CalibrationFault):
        Plane(h)


@pytest.mark.parametrize(
    ("unit", "far"), [(1e-9, 0.0), (1e9, 0.0), (1e-3, 5e6)], ids=["km", "nm", "map projection"]
)
def test_the_fit_is_the_same_in_all_units_and_far_from_the_origin(unit: float, far: float):
    """With an error in a pair, so that there is something to weigh."""
    pixels = np.array([(31, 297), (462, 320), (380, 75), (70, 60), (240, 190)], float)
    world = np.array([(0, 0), (800, 0), (800, 400), (0, 400), (430, 158)], float)
    expected, fit = fit_plane(pixels, world), fit_plane(pixels, world * unit + far)
    np.testing.assert_allclose(fit.residuals / unit, expected.residuals, rtol=1e-4)
    assert fit.per_pixel / unit == pytest.approx(expected.per_pixel, rel=1e-4)
    Plane(fit.plane.h)  # as it is read from a file


# The way through a lens and onto the plane.


@pytest.mark.parametrize(("y_up", "mirrored"), [(0.005, False), (-0.005, True)])
def test_a_plane_is_mirrored_if_its_y_is_up_where_that_of_the_picture_is_down(
    y_up: float, mirrored: bool
):
    plane = Plane((0.004, 0, 0, 0, y_up, 0, 0, 0.0008, 1))
    whole = Calibration(BENT, plane=plane)
    for sideways, upside_down in ((False, False), (True, False), (False, True), (True, True)):
        view = whole.mirrored(sideways=sideways, upside_down=upside_down).view
        assert view is not None
        assert view.mirrored is (mirrored ^ sideways ^ upside_down)


def test_positions_return_to_their_pixels():
    view = PlaneView(BENT, TILTED)
    np.testing.assert_allclose(view.pixels(view.positions(PIXELS)), PIXELS, atol=1e-3)


def test_the_jacobian_tells_how_far_a_small_step_leads():
    view = PlaneView(BENT, TILTED)
    pixel, step = np.array((450.0, 80.0)), np.array((0.12, -0.06))
    here, there = view.positions(np.stack((pixel, pixel + step)))
    np.testing.assert_allclose(view.jacobian(*pixel) @ step, there - here, rtol=1e-3)


def test_the_jacobian_of_a_plane_seen_straight_on_is_its_scale():
    view = PlaneView(CameraModel(640, 480, K), Plane((0.01, 0, -2, 0, -0.01, 3, 0, 0, 1)))
    np.testing.assert_allclose(view.jacobian(100, 100), [[0.01, 0], [0, -0.01]], atol=1e-12)


def test_a_pixel_beyond_the_horizon_has_neither_position_nor_jacobian():
    view = PlaneView(CameraModel(640, 480, K), Plane((1, 0, 0, 0, 0, 1000, 0, 1, -100)))
    assert view.position(10, 50) is None
    assert view.jacobian(10, 50) is None
