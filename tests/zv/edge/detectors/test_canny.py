"""Edges where they are known to be, and OpenCV as the second opinion."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from zv.edge.detectors.canny import Canny

SCENE = np.asarray(
    cv2.resize(
        np.random.default_rng(1).integers(0, 256, (24, 32), np.uint8),
        (320, 240),
        interpolation=cv2.INTER_CUBIC,
    ),
    np.uint8,
)


def step() -> np.ndarray:
    """Return 0 left of column 15 and 100 from there."""
    picture = np.zeros((20, 30), np.uint8)
    picture[:, 15:] = 100
    return picture


def diagonal() -> np.ndarray:
    """Return 100 where x + y is at least 40, else 0."""
    return np.where(np.add.outer(np.arange(40), np.arange(40)) >= 40, 100, 0).astype(np.uint8)


def edges(picture: np.ndarray, **changed) -> np.ndarray:
    options = {"sigma": 0.0, "low": 40.0, "high": 100.0, "aperture": 3, "l2": True} | changed
    return Canny(**options).detect(picture).edges


@pytest.mark.parametrize("l2", [True, False], ids=["L2", "L1"])
@pytest.mark.parametrize("aperture", [3, 5, 7])
@pytest.mark.parametrize("sigma", [0.5, 1.4, 3.0])
def test_edges_are_those_of_opencv_after_its_gaussian(sigma: float, aperture: int, l2: bool):
    low, high = {3: (40, 100), 5: (400, 1000), 7: (400, 1000)}[aperture]
    smoothed = cv2.GaussianBlur(SCENE, (0, 0), sigma)
    expected = cv2.Canny(smoothed, low, high, apertureSize=aperture, L2gradient=l2)
    found = edges(SCENE, sigma=sigma, low=low, high=high, aperture=aperture, l2=l2)
    assert expected.any()
    assert np.array_equal(found, expected)


def test_sigma_0_does_not_smooth():
    found = edges(SCENE, low=400, high=1000)
    assert np.array_equal(found, cv2.Canny(SCENE, 400, 1000, L2gradient=True))
    # A lattice of single bright pixels is all gradient; smoothed, it is nearly flat.
    lattice = np.zeros((40, 40), np.uint8)
    lattice[::4, ::4] = 200
    assert edges(lattice, low=40, high=100).any()
    assert not edges(lattice, sigma=3.0, low=40, high=100).any()


@pytest.mark.parametrize("aperture", [3, 5, 7])
@pytest.mark.parametrize("sigma", [0.0, 1.4])
def test_a_step_gives_one_line_at_the_last_dark_column(sigma: float, aperture: int):
    """The gradient is equal at columns 14 and 15 and less beside them; of equals the left one
    is kept."""
    found = edges(step(), sigma=sigma, aperture=aperture)
    assert np.unique(np.nonzero(found)[1]).tolist() == [14]
    assert found[:, 14].all()


@pytest.mark.parametrize("l2", [True, False], ids=["L2", "L1"])
def test_a_vertical_step_of_100_has_a_gradient_of_400(l2: bool):
    """Sobel's right column is 1 + 2 + 1 times 100, its left one 0, and nothing vertical. Only
    what is above ``high`` is an edge."""
    assert edges(step(), low=399, high=399, l2=l2).any()
    assert not edges(step(), low=400, high=400, l2=l2).any()


@pytest.mark.parametrize(
    ("l2", "last"), [(True, 424), (False, 599)], ids=["sqrt(2) 300 = 424.3", "300 + 300 = 600"]
)
def test_a_diagonal_step_of_100_is_weaker_by_l2_than_by_l1(l2: bool, last: int):
    """On x + y = 39 Sobel sees, to the right, 0, 2 x 100, 1 x 100, to the left nothing: 300;
    the same downwards."""
    inside = slice(5, 35)  # without the picture's border, where rows repeat
    assert edges(diagonal(), low=last, high=last, l2=l2)[inside, inside].any()
    assert not edges(diagonal(), low=last + 1, high=last + 1, l2=l2)[inside, inside].any()


def test_a_weak_edge_remains_only_beside_a_strong_one():
    """Hysteresis: steps of 40 have a gradient of 160, between low and high."""
    weak = np.zeros((40, 30), np.uint8)
    weak[:, 15:] = 40
    assert not edges(weak, low=100, high=200).any()
    joined = weak.copy()
    joined[:5, 15:] = 100
    assert edges(joined, low=100, high=200)[39, 14] == 255


def test_the_low_threshold_ends_a_line():
    joined = np.zeros((40, 30), np.uint8)
    joined[:5, 15:] = 100
    joined[5:, 15:] = 40
    assert not edges(joined, low=161, high=200)[10:].any()


@pytest.mark.parametrize("sigma", [0.0, 1.4])
def test_an_edge_map_is_0_and_255_and_has_the_size_of_the_picture(sigma: float):
    before = SCENE.copy()
    found = edges(SCENE, sigma=sigma)
    assert (found.dtype, found.shape) == (np.uint8, SCENE.shape)
    assert set(np.unique(found)) == {0, 255}
    assert np.array_equal(SCENE, before)


def test_a_flat_picture_has_no_edges():
    assert not edges(np.full((40, 40), 128, np.uint8), low=0, high=0).any()
