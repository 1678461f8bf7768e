"""Every detector finds steps of known positions in all orientations, thin and in one piece."""

from __future__ import annotations

import numpy as np
import pytest

from tests.support.pictures.analytic_edges import Step, judge
from zv.edge.detectors.available import DETECTORS
from zv.edge.detectors.detection import STAGES

ANGLES = [3.7 + 15 * turn for turn in range(24)]
GRAY_DETECTORS = sorted(name for name, kind in DETECTORS.items() if kind.wants == "gray")
HALF_A_PIXEL_OFF = "roberts"
"""It compares the pixels around a corner."""

MOST_FALSE = {"laplacian_of_gaussian": 30}
"""Edge pixels in the noise of 24 pictures: a third derivative is the most sensitive to it."""


@pytest.mark.parametrize("noise", [0.0, 10.0])
@pytest.mark.parametrize("name", GRAY_DETECTORS)
def test_a_step_is_found_at_its_position_in_every_direction(name: str, noise: float):
    """The nearest pixels of a line are up to 0.5 of a pixel off along the axes and 0.71 along the
    diagonals: 0.35 in the mean square is the least."""
    judged = []
    for angle in ANGLES:
        step = Step(angle, offset=0.25)
        edges = DETECTORS[name]().detect(step.picture(noise)).edges
        judged.append(judge(step, edges))
    errors = np.concatenate([each.errors for each in judged])
    assert np.sqrt((errors**2).mean()) < (0.65 if name == HALF_A_PIXEL_OFF else 0.39)
    assert max(each.missed for each in judged) == 0
    assert sum(each.blocks for each in judged) == 0
    assert sum(each.false for each in judged) <= (0 if noise == 0 else MOST_FALSE.get(name, 5))


@pytest.mark.parametrize("name", GRAY_DETECTORS)
def test_an_ideal_step_has_about_the_same_strength_for_every_detector(name: str):
    """Of h grey levels after a Gaussian of s: 8 h / (s sqrt(2 pi)), here 228 with s = 1.4; the
    pixels and the operators' windows smooth it more."""
    found = DETECTORS[name]().detect(Step(0, 0.0).picture())
    middle = found.strength[48, 40:56]
    assert 150 < middle.max() < 260


@pytest.mark.parametrize("name", [name for name in GRAY_DETECTORS if name != "canny"])
def test_the_threshold_divides_the_strengths(name: str):
    picture = Step(30, 0.3).picture(noise=10)
    found = DETECTORS[name](high=120.0).detect(picture)
    assert np.array_equal(found.edges > 0, found.strength > 120)
    assert (found.strength > 0).sum() > (found.edges > 0).sum() > 0


@pytest.mark.parametrize("name", GRAY_DETECTORS)
def test_strengths_stay_within_the_full_scale(name: str):
    noise = np.random.default_rng(1).integers(0, 2, (60, 80)).astype(np.uint8) * 255
    detector = DETECTORS[name]()
    strength = detector.detect(noise).strength
    assert 0 < strength.max() <= detector.full_scale * 1.5
    assert strength.min() == 0


@pytest.mark.parametrize("shape", [(1, 1), (1, 9), (7, 1), (2, 2), (3, 300), (33, 47)], ids=str)
@pytest.mark.parametrize("name", DETECTORS)
def test_a_picture_of_any_size_has_a_map_and_stages_of_its_size(name: str, shape: tuple[int, int]):
    channels = (3,) * (DETECTORS[name].wants == "bgr")
    picture = np.random.default_rng(2).integers(0, 256, (*shape, *channels), np.uint8)
    before = picture.copy()
    found = DETECTORS[name]().detect(picture)
    assert found.edges.shape == found.strength.shape == shape
    assert set(np.unique(found.edges)) <= {0, 255}
    assert tuple(found.stages) == STAGES
    for make in found.stages.values():
        assert (make().shape[:2], make().dtype) == (shape, np.uint8)
    assert np.array_equal(picture, before)


@pytest.mark.parametrize("name", GRAY_DETECTORS)
def test_a_flat_picture_has_no_edges(name: str):
    for gray in (0, 128, 255):
        found = DETECTORS[name]().detect(np.full((40, 50), gray, np.uint8))
        assert not found.edges.any()
        assert not (found.strength > 0.5).any()
