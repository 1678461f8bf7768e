"""Each classical detector against scipy.ndimage, a least-squares fit, or the formula by hand."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from scipy import ndimage

from tests.support.pictures.encoded import smooth
from zv.edge.detectors import zero_crossings
from zv.edge.detectors.gradient import Prewitt, Roberts, Scharr, Sobel
from zv.edge.detectors.haralick import Haralick, crossings_of, fit
from zv.edge.detectors.laplacian_of_gaussian import LaplacianOfGaussian, derivatives
from zv.edge.detectors.zero_crossings import ZeroCrossingDetector, thin_strength

GRAY = np.asarray(cv2.cvtColor(smooth(60, 50, detail=6), cv2.COLOR_BGR2GRAY), np.uint8)
REAL = GRAY.astype(np.float64)


@pytest.mark.parametrize(
    ("kind", "side", "middle"), [(Sobel, 1, 2), (Prewitt, 1, 1), (Scharr, 3, 10)]
)
def test_an_operator_is_a_correlation_with_its_kernel(kind: type, side: int, middle: int):
    kernel = np.outer([side, middle, side], [-1, 0, 1])
    found = kind(sigma=0).detect(GRAY)
    gx, gy = (ndimage.correlate(REAL, each, mode="nearest") for each in (kernel, kernel.T))
    assert np.array_equal(found.gradient[0], gx)
    assert np.array_equal(found.gradient[1], gy)
    unit = 8 / kernel[:, 2].sum() / 2
    assert found.magnitude == pytest.approx(np.hypot(gx, gy) * unit, rel=1e-5)
    manhattan = kind(sigma=0, l2=False).detect(GRAY).magnitude
    assert manhattan == pytest.approx((abs(gx) + abs(gy)) * unit, rel=1e-5)


def test_roberts_is_the_cross_of_diagonal_differences():
    """The pixel against its lower right neighbour, and the right one against the lower one."""
    padded = np.pad(REAL, ((0, 1), (0, 1)), mode="edge")
    one = padded[:-1, :-1] - padded[1:, 1:]
    other = padded[:-1, 1:] - padded[1:, :-1]
    found = Roberts(sigma=0).detect(GRAY)
    # In the unit of all operators: a slope of 1 is sqrt(2) on the cross, and 8 there.
    expected = np.hypot(one, other) * 8 / 2**0.5
    assert found.magnitude == pytest.approx(expected, rel=1e-5, abs=1e-3)
    turned = (found.gradient[0] + found.gradient[1]) / 2  # along the falling diagonal
    assert np.array_equal(turned, -one)


@pytest.mark.parametrize("kind", [Roberts, Prewitt, Sobel, Scharr], ids=lambda kind: kind.__name__)
def test_a_slope_of_2_per_pixel_is_16_for_every_operator(kind: type):
    ramp = np.tile(np.arange(0, 80, 2, dtype=np.uint8), (20, 1))
    assert kind(sigma=0).detect(ramp).magnitude[5:15, 5:-5] == pytest.approx(16)


@pytest.mark.parametrize("sigma", [0.5, 1.4, 3.0])
def test_the_laplacian_of_gaussian_is_that_of_scipy(sigma: float):
    response, gx, gy = derivatives(GRAY, sigma)
    expected = ndimage.gaussian_laplace(REAL, sigma, mode="nearest")
    assert response == pytest.approx(expected, abs=2e-3)
    for found, order in ((gx, (0, 1)), (gy, (1, 0))):
        expected = ndimage.gaussian_filter(REAL, sigma, order, mode="nearest")
        assert found == pytest.approx(expected, abs=2e-3)


@pytest.mark.parametrize("sigma", [8.0, 13.0, 20.0])
def test_a_wide_laplacian_of_gaussian_is_that_of_scipy_within_1_percent(sigma: float):
    """It is interpolated between the pixels of a reduced picture."""
    scene = cv2.resize(GRAY, (131, 117), interpolation=cv2.INTER_CUBIC)
    expected = ndimage.gaussian_laplace(scene.astype(float), sigma, mode="nearest")
    response, _, _ = derivatives(np.asarray(scene, np.uint8), sigma)
    assert response == pytest.approx(expected, abs=0.01 * np.abs(expected).max())


@pytest.mark.parametrize(
    "detector",
    [Haralick(), Haralick(window=11), LaplacianOfGaussian(), LaplacianOfGaussian(sigma=13)],
    ids=repr,
)
def test_strips_give_the_result_of_the_whole_picture(
    detector: ZeroCrossingDetector, monkeypatch: pytest.MonkeyPatch
):
    tall = np.asarray(cv2.resize(GRAY, (40, 500), interpolation=cv2.INTER_CUBIC), np.uint8)
    whole = detector.detect(tall)
    monkeypatch.setattr(zero_crossings, "STRIP_PIXELS", 0)
    parts = detector.detect(tall)
    assert parts.strength == pytest.approx(whole.strength, abs=1e-3)
    assert (whole.strength > 0).sum() > 100
    assert np.abs(parts.stages["magnitude"]().astype(int) - whole.stages["magnitude"]()).max() <= 1


def test_the_slope_of_a_zero_crossing_is_that_of_the_formula():
    """Along x the response to a step is h times the derivative of a Gaussian, whose slope at 0 is
    h / (sqrt(2 pi) s^3): the same h and s have the gradient h / (sqrt(2 pi) s), times 8."""
    step = np.zeros((80, 80), np.uint8)
    step[:, 40:] = 100
    found = LaplacianOfGaussian(sigma=4, high=0).detect(step)
    expected = 8 * 100 / ((2 * np.pi) ** 0.5 * 4)
    assert found.strength[40].max() == pytest.approx(expected, rel=0.06)
    assert np.flatnonzero(found.edges[40] > 0).tolist() in ([39], [40])


def test_the_dark_side_of_the_end_of_a_ramp_is_no_edge():
    """Where a slope begins and ends, the Laplacian is not 0 but largest; between, it is 0 without
    a change of sign."""
    ramp = np.clip((np.arange(120) - 40) * 4, 0, 160).astype(np.uint8)
    found = LaplacianOfGaussian(sigma=1.4, high=5).detect(np.tile(ramp, (40, 1)))
    assert not found.edges.any()


@pytest.mark.parametrize("window", [5, 7])
def test_a_facet_is_the_least_squares_cubic(window: int):
    half = window // 2
    row, column = 20, 30
    y, x = np.mgrid[-half : half + 1, -half : half + 1]
    powers = [(0, 0), (1, 0), (0, 1), (2, 0), (1, 1), (0, 2), (3, 0), (2, 1), (1, 2), (0, 3)]
    basis = np.stack([(x**p * y**q).ravel() for p, q in powers], axis=1)
    pixels = REAL[row - half : row + half + 1, column - half : column + half + 1].ravel()
    expected, *_ = np.linalg.lstsq(basis, pixels, rcond=None)
    facets = fit(GRAY, window)
    names = ("x", "y", "xx", "xy", "yy", "xxx", "xxy", "xyy", "yyy")
    found = [getattr(facets, name)[row, column] for name in names]
    assert found == pytest.approx(expected[1:], abs=1e-3)


def test_the_crossing_of_a_cubic_is_found_exactly():
    """f(x) = 100 + 12 t - t^3 with t = x - 20.25: the slope is largest, 12, at t = 0."""
    t = np.arange(17, 25) - 20.25
    cubic = 100 + 12 * t - t**3
    # Sixteen rows of real numbers: the fit takes any pixels, and rounding would hide the test.
    found = crossings_of(fit(np.tile(cubic, (16, 1)).astype(np.float32), 5))  # type: ignore[arg-type]
    strength = thin_strength(found)
    assert found.distance[8, 3] == pytest.approx(0.25, abs=1e-3)
    assert np.flatnonzero(strength[8, 2:6]).tolist() == [1]
    assert strength[8, 3] == pytest.approx(8 * 12, abs=0.01)


def test_a_minimum_of_the_slope_is_no_edge():
    """f(x) = 100 + t + t^3: the slope is smallest at t = 0, where the second derivative rises."""
    t = np.arange(-4, 5).astype(float)
    cubic = np.tile(100 + t + t**3, (16, 1))
    found = crossings_of(fit(cubic.astype(np.float32), 5))  # type: ignore[arg-type]
    assert np.isinf(found.distance[8, 4])
    assert thin_strength(found)[8, 4] == 0
