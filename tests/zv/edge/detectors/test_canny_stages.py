"""The steps of Canny end in the result of ``cv2.Canny``, and each follows its definition."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from tests.support.pictures.encoded import smooth
from zv.edge.detectors.canny import Canny, CannyDetection
from zv.edge.detectors.detection import STAGES

GRAY = np.asarray(cv2.cvtColor(smooth(160, 120, detail=10), cv2.COLOR_BGR2GRAY), np.uint8)

PICTURES = arrays(
    np.uint8, st.tuples(st.integers(1, 12), st.integers(1, 12)), elements=st.integers(0, 255)
)
LARGEST = {3: 2100.0, 5: 25_000.0, 7: 100_000.0}


@st.composite
def cannys(draw: st.DrawFn) -> Canny:
    """Any Canny that the settings allow, most with thresholds that a gradient can reach."""
    aperture = draw(st.sampled_from([3, 5, 7]))
    thresholds = st.one_of(
        st.integers(0, int(LARGEST[aperture])).map(float),
        st.floats(0, LARGEST[aperture]),
        st.floats(0, 100_000),
    )
    low, high = sorted([draw(thresholds), draw(thresholds)])
    sigma = draw(st.sampled_from([0.0, 0.5, 1.4, 3.0]))
    return Canny(sigma=sigma, low=low, high=high, aperture=aperture, l2=draw(st.booleans()))


def canny_of_opencv(canny: Canny, picture: np.ndarray) -> np.ndarray:
    smoothed = cv2.GaussianBlur(picture, (0, 0), canny.sigma) if canny.sigma else picture
    return cv2.Canny(
        smoothed, canny.low, canny.high, apertureSize=canny.aperture, L2gradient=canny.l2
    )


def maxima_by_definition(gx: np.ndarray, gy: np.ndarray, l2: bool) -> np.ndarray:
    """Evaluate the rule of non-maximum suppression for each pixel, in Python's integers."""
    height, width = gx.shape
    x, y = gx.astype(int), gy.astype(int)
    size = np.zeros((height + 2, width + 2), int)  # 0 outside of the picture
    size[1:-1, 1:-1] = x * x + y * y if l2 else abs(x) + abs(y)
    found = np.zeros((height, width), bool)
    for row, column in np.ndindex(height, width):
        here = size[row + 1, column + 1]
        dx, dy = int(x[row, column]), int(y[row, column])
        slope = abs(dy) / abs(dx) if dx else np.inf
        if slope < 0.41421356:  # tan 22.5 degrees: compare left and right
            before, after, strict = size[row + 1, column], size[row + 1, column + 2], False
        elif slope > 2.41421356:
            before, after, strict = size[row, column + 1], size[row + 2, column + 1], False
        else:
            step = -1 if dx * dy < 0 else 1
            before, after = size[row, column + 1 - step], size[row + 2, column + 1 + step]
            strict = True
        found[row, column] = here > before and (here > after if strict else here >= after)
    return found


@settings(max_examples=300, deadline=None)
@given(PICTURES, cannys())
def test_the_steps_end_in_opencvs_edge_map_on_random_pictures(picture: np.ndarray, canny: Canny):
    found = canny.detect(picture)
    expected = canny_of_opencv(canny, picture)
    assert np.array_equal(found.edges, expected)
    assert np.array_equal(found.thinned(canny.low, canny.high), expected)


@pytest.mark.parametrize("threads", [1, 2])
def test_no_gradient_reaches_a_threshold_whose_square_needs_more_than_32_bits(threads: int):
    step = np.ones((4, 4), np.uint8)
    step[0, 0] = 0
    before = cv2.getNumThreads()
    cv2.setNumThreads(threads)
    try:
        assert not Canny(sigma=0, l2=True).detect(step).thinned(0, 46341).any()
    finally:
        cv2.setNumThreads(before)


@pytest.mark.parametrize("l2", [True, False], ids=["L2", "L1"])
@pytest.mark.parametrize("aperture", [3, 5, 7])
@pytest.mark.parametrize("sigma", [0.0, 1.0, 2.0])
def test_the_steps_end_in_opencvs_edge_map_on_a_scene(sigma: float, aperture: int, l2: bool):
    for low, high in [(0.1, 0.3), (0.02, 0.02), (0.0, 0.5)]:
        scale = Canny(aperture=aperture, l2=l2).full_scale / 2
        canny = Canny(sigma=sigma, low=low * scale, high=high * scale, aperture=aperture, l2=l2)
        expected = canny_of_opencv(canny, GRAY)
        found = canny.detect(GRAY)
        assert np.array_equal(found.thinned(canny.low, canny.high), expected)
        assert np.array_equal(found.edges, expected)


@settings(max_examples=100, deadline=None)
@given(PICTURES, st.sampled_from([3, 5, 7]), st.booleans())
def test_suppressed_pixels_are_maxima_by_definition(picture: np.ndarray, aperture: int, l2: bool):
    found = Canny(sigma=0, aperture=aperture, l2=l2).detect(picture)
    expected = maxima_by_definition(*found.gradient, l2)
    assert np.array_equal(found.strength > 0, expected)


@pytest.mark.parametrize(("aperture", "gain"), [(3, 4), (5, 48), (7, 640)])
def test_a_step_of_the_whole_range_is_the_full_scale_of_l1_by_half(aperture: int, gain: int):
    """A vertical step has no vertical derivative; both at once reach the full scale."""
    step = np.zeros((20, 20), np.uint8)
    step[:, 10:] = 255
    canny = Canny(sigma=0, aperture=aperture, l2=False)
    found = canny.detect(step)
    assert found.magnitude.max() == pytest.approx(255 * gain)
    assert canny.full_scale == 2 * 255 * gain


def test_the_steps_are_pictures_of_the_size_of_the_frame():
    found = Canny().detect(GRAY)
    made = {name: make() for name, make in found.stages.items()}
    assert tuple(made) == STAGES
    assert {name: each.shape[2:] for name, each in made.items() if each.ndim > 2} == {
        "direction": (3,)
    }
    assert {(each.shape[:2], each.dtype.name) for each in made.values()} == {(GRAY.shape, "uint8")}


def test_the_edge_map_computes_no_step(monkeypatch: pytest.MonkeyPatch):
    def fail(*_: object) -> None:
        raise AssertionError("a step was computed")

    for name in ("gradient", "magnitude", "strength"):
        monkeypatch.setattr(CannyDetection, name, property(fail))
    assert Canny().detect(GRAY).edges.any()


@pytest.mark.parametrize(
    ("turned", "hue"),
    [(0, (0, 0, 255)), (1, (255, 0, 127)), (2, (255, 255, 0)), (3, (0, 255, 128))],
    ids=["right: red", "up: violet", "left: cyan", "down: yellow-green"],
)
def test_the_hue_shows_the_direction_towards_the_brighter_side(
    turned: int, hue: tuple[int, int, int]
):
    step = np.zeros((20, 20), np.uint8)
    step[:, 10:] = 255
    picture = np.rot90(step, turned)  # anticlockwise: bright on the right, above, left, below
    found = Canny(sigma=0, l2=True).detect(np.ascontiguousarray(picture))
    shown = found.stages["direction"]()[10, 10].astype(float)
    assert shown / shown.max() * 255 == pytest.approx(hue, abs=3)


def test_weak_and_strong_pixels_have_two_greys():
    """Steps of 40 and 100 have gradients of 160 and 400."""
    step = np.zeros((40, 30), np.uint8)
    step[:20, 15:] = 40
    step[20:, 15:] = 100
    found = Canny(sigma=0, low=100, high=300).detect(step)
    shown = found.stages["thresholded"]()
    assert (shown[5, 14], shown[35, 14], shown[5, 5]) == (128, 255, 0)
    assert found.edges[5, 14] == 255  # connected to the strong ones
