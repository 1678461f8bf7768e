"""A frame takes no more memory than the setting ``max_pixels`` says."""

from __future__ import annotations

import re
import tracemalloc

import cv2
import numpy as np
import pytest

from tests.support.headers import header
from zenoh_vision.image.frame import Frame
from zv.edge.detectors.available import DETECTORS
from zv.edge.finding import EdgesOfFrame
from zv.edge.settings import EdgeSettings

WIDTH, HEIGHT = 1200, 1000


@pytest.mark.parametrize("detector", DETECTORS)
def test_a_frame_with_all_steps_needs_no_more_memory_than_stated(detector: str):
    coarse = np.random.default_rng(0).integers(0, 256, (40, 48, 3)).astype(np.uint8)
    picture = np.asarray(
        cv2.resize(coarse, (WIDTH, HEIGHT), interpolation=cv2.INTER_NEAREST), np.uint8
    )
    settings = EdgeSettings.model_validate({"detector": detector})
    description = EdgeSettings.model_fields["max_pixels"].description
    stated = re.search(r"(\d+) bytes of memory per pixel", description)
    assert stated
    tracemalloc.start()  # OpenCV's results are NumPy's memory, which it follows
    try:
        found = EdgesOfFrame(Frame(header(width=WIDTH, height=HEIGHT), pixels=picture), settings)
        assert found.edges.any()
        for make in found.stages.values():
            make()
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert peak < int(stated[1]) * WIDTH * HEIGHT
