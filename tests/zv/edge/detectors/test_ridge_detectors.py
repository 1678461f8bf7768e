"""The detectors ``colour`` and ``learned``: boundaries, their positions, and density."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from tests.support.pictures.analytic_edges import Step, judge
from zv.edge.detectors import learned
from zv.edge.detectors.available import DETECTORS
from zv.edge.detectors.canny import Canny
from zv.edge.detectors.learned import Learned, network_size
from zv.edge.detectors.ridges import enlarged

WEIGHTS = Path(learned.__file__).with_name("learned.onnx")
NAMES = sorted(name for name, kind in DETECTORS.items() if kind.wants == "bgr")
RED, GREEN = (0, 0, 200), (0, 102, 0)
"""Both have grey level 60: 0.299 * 200 = 59.8, 0.587 * 102 = 59.9."""


def coloured(step: Step, noise: float, seed: int = 0) -> NDArray[np.uint8]:
    return np.repeat(step.picture(noise, seed)[:, :, None], 3, axis=2)


def in_halves(left: tuple[int, int, int], right: tuple[int, int, int]) -> NDArray[np.uint8]:
    """A picture of 64 x 96 pixels; the boundary is left of column 48."""
    picture = np.empty((64, 96, 3), np.uint8)
    picture[:, :48], picture[:, 48:] = left, right
    return picture


@pytest.mark.parametrize("name", NAMES)
def test_a_boundary_between_colours_of_one_brightness_is_found_where_canny_finds_none(name: str):
    picture = in_halves(RED, GREEN)
    grey = np.asarray(cv2.cvtColor(picture, cv2.COLOR_BGR2GRAY), np.uint8)
    assert not Canny(low=1, high=2).detect(grey).edges.any()
    edges = DETECTORS[name]().detect(picture).edges[8:-8]
    assert (edges > 0).sum(axis=1).tolist() == [1] * 48
    assert {int(column) for column in np.nonzero(edges)[1]} <= {46, 47, 48, 49}


@pytest.mark.parametrize("name", NAMES)
def test_a_grey_step_is_found_within_a_pixel_in_every_direction(name: str):
    judged = []
    for angle in [3.7 + 30 * turn for turn in range(12)]:
        step = Step(angle, offset=0.25)
        judged.append(judge(step, DETECTORS[name]().detect(coloured(step, 5.0)).edges))
    errors = np.concatenate([each.errors for each in judged])
    assert np.sqrt((errors**2).mean()) < 1.0
    assert max(each.missed for each in judged) == 0


@pytest.mark.parametrize("name", NAMES)
def test_the_noise_of_an_empty_picture_is_no_edge(name: str):
    noise = np.random.default_rng(0).normal(128, 4, (120, 160, 3))
    assert not DETECTORS[name]().detect(np.clip(noise, 0, 255).astype(np.uint8)).edges.any()


def test_colour_finds_a_boundary_of_areas_far_stronger_than_stripes_of_the_same_colours():
    picture = np.empty((128, 512, 3), np.uint8)
    picture[:] = RED
    picture[:, 128:256] = GREEN
    picture[:, 256:][:, np.arange(256) // 8 % 2 == 1] = GREEN
    strength = DETECTORS["colour"]().detect(picture).strength
    boundary, stripes = (
        float(strength[32:96, middle - 28 : middle + 28].max()) for middle in (128, 384)
    )
    # Stripes of 8 pixels have no difference at the coarse scales. The two fine scales alone rate
    # the boundary 2.3 times as high.
    assert boundary / (1 - boundary) > 3 * stripes / (1 - stripes) > 0


def test_noise_beside_a_strong_boundary_is_hardly_an_edge_for_colour():
    false = []
    for number, angle in enumerate(range(0, 360, 15)):
        step = Step(float(angle), offset=0.25)
        found = DETECTORS["colour"]().detect(coloured(step, 20.0, number))
        false.append(judge(step, found.edges).false)
    assert np.mean(false) < 4


@pytest.mark.parametrize("name", NAMES)
def test_a_larger_density_adds_edges_and_removes_none(name: str):
    picture = cv2.GaussianBlur(
        np.random.default_rng(1).integers(0, 256, (96, 128, 3)).astype(np.uint8), (0, 0), 3
    )
    picture = np.asarray(cv2.normalize(picture, None, 0, 255, cv2.NORM_MINMAX), np.uint8)
    few, some, many = (
        DETECTORS[name](density=density).detect(picture).edges > 0 for density in (0.5, 3.5, 7.0)
    )
    assert few.sum() < some.sum() < many.sum()
    assert not DETECTORS[name](density=0.0).detect(in_halves(RED, (255, 255, 255))).edges.any()
    assert not (few & ~some).any()
    assert not (some & ~many).any()


@pytest.mark.parametrize("name", NAMES)
def test_edges_are_a_subset_of_the_thinned_strengths_with_all_strong_ones(name: str):
    detector = DETECTORS[name]()
    found = detector.detect(in_halves(RED, GREEN))
    assert ((found.edges > 0) <= (found.strength > 0)).all()
    assert 0 < found.strength.max() <= detector.full_scale
    assert found.strength.dtype == np.float32
    assert (found.stages["thresholded"]() == 255)[found.edges > 0].any()


@pytest.mark.parametrize("name", NAMES)
def test_the_same_picture_gives_the_same_edges(name: str):
    picture = np.random.default_rng(3).integers(0, 256, (60, 82, 3)).astype(np.uint8)
    detector = DETECTORS[name]()
    first = detector.detect(picture).strength
    assert not detector.detect(np.zeros((32, 32, 3), np.uint8)).edges.any()
    assert np.array_equal(first, detector.detect(picture).strength)


def test_learned_marks_no_edge_along_the_border_of_a_picture():
    random = np.random.default_rng(4)
    coarse = random.integers(0, 256, (9, 12, 3)).astype(np.uint8)
    picture = np.asarray(cv2.resize(coarse, (192, 144), interpolation=cv2.INTER_CUBIC), np.uint8)
    found = DETECTORS["learned"](density=10.0).detect(picture)
    for kept in (found.edges, found.strength):
        assert kept[3:-3, 3:-3].any()
        assert np.count_nonzero(kept) == np.count_nonzero(kept[3:-3, 3:-3])


@pytest.mark.parametrize(
    ("size", "expected"),
    [
        ((240, 320), (128, 176)),  # 0.55 of each side, 132 x 176
        ((321, 481), (176, 256)),  # 45,000 pixels of this shape are 173.3 x 259.7
        ((480, 640), (176, 240)),  # 183.7 x 244.9
        ((1080, 1920), (272, 480)),  # a quarter, 270 x 480
        ((1, 9), (16, 16)),
    ],
)
def test_the_networks_input_has_sides_of_multiples_of_16(
    size: tuple[int, int], expected: tuple[int, int]
):
    assert network_size(*size) == expected


def test_a_map_is_enlarged_by_the_pixel_in_which_each_of_the_larger_one_lies():
    values = np.array([[1, 2, 3], [4, 5, 6]], np.int16)
    rows, columns = [0, 0, 1, 1], [0, 0, 0, 1, 1, 2, 2]  # 3 columns in 7: borders at 2.33 and 4.67
    larger = enlarged(values, (4, 7))
    assert larger.dtype == np.int16
    assert np.array_equal(larger, values[rows][:, columns])


def test_the_networks_logits_become_probabilities_in_the_pictures_order():
    planes = np.random.default_rng(5).normal(0, 1, (1, 6, 32, 48)).astype(np.float32)
    network = cv2.dnn.readNetFromONNX(str(WEIGHTS), cv2.dnn.ENGINE_CLASSIC)
    network.setInput(planes)
    logits = network.forward()[0].astype(np.float64)
    probabilities = Learned.network.probabilities(planes)
    assert probabilities.dtype == np.float32
    assert probabilities.shape == (32, 48)
    for y in range(2):
        for x in range(2):
            expected = 1 / (1 + np.exp(-logits[2 * y + x]))
            assert np.allclose(probabilities[y::2, x::2], expected, atol=1e-6)
