"""The edge detector's settings reach its arithmetic."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from tests.support.pictures import smooth
from zenoh_vision.image import codecs
from zenoh_vision.image.frame import Frame
from zenoh_vision.messages import Header
from zv.edge.service import edges_of
from zv.edge.settings import EdgeSettings

JPEG = codecs.encode_jpeg(smooth(160, 120, detail=10), "bgr8", 90)
HEADER = Header(camera="front", epoch=1, seq=0, stamp_ns=0, width=160, height=120, encoding="bgr8")


@pytest.mark.parametrize(
    "changed",
    [
        {},
        {"sigma": 0.0},
        {"sigma": 3.0},
        {"low": 90.0},
        {"high": 200.0},
        {"aperture": 5},
        {"aperture": 7},
        {"l2": False},
    ],
    ids=str,
)
def test_every_setting_is_canny_on_the_grey_decode(changed: dict):
    numbers = {"sigma": 1.4, "low": 40.0, "high": 100.0, "aperture": 3, "l2": True} | changed
    gray = cv2.imdecode(np.frombuffer(JPEG, np.uint8), cv2.IMREAD_GRAYSCALE)
    if numbers["sigma"]:
        gray = cv2.GaussianBlur(gray, (0, 0), numbers["sigma"])
    expected = cv2.Canny(
        gray,
        numbers["low"],
        numbers["high"],
        apertureSize=numbers["aperture"],
        L2gradient=numbers["l2"],
    )
    frame = Frame(HEADER, compressed=JPEG)
    found = edges_of(frame, EdgeSettings.model_validate(changed))
    assert np.array_equal(found, expected)
    default = edges_of(frame, EdgeSettings())
    assert np.array_equal(found, default) == (not changed)
