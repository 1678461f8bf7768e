"""The edge detector's settings reach its arithmetic and limit its memory."""

from __future__ import annotations

import re
import tracemalloc
from pathlib import Path
from unittest.mock import Mock

import cv2
import numpy as np
import pytest

from tests.support.headers import header
from tests.support.pictures.encoded import smooth
from zenoh_vision.config.constraints import choices
from zenoh_vision.config.settings import load_settings
from zenoh_vision.errors import ConfigurationError, PayloadError, SourceError
from zenoh_vision.image import codecs, pixel_formats
from zenoh_vision.image.frame import Frame
from zenoh_vision.messages import Contours
from zv.edge.contours import Lines
from zv.edge.detectors.available import DETECTORS, detector_named
from zv.edge.detectors.canny import Canny
from zv.edge.finding import EdgesOfFrame, decode_ahead
from zv.edge.service import read_mask
from zv.edge.settings import EdgeSettings

JPEG = codecs.encode_jpeg(smooth(160, 120, detail=10), "bgr8", 90)
HEADER = header(width=160, height=120)


def edges_of(changed: dict) -> EdgesOfFrame:
    return EdgesOfFrame(
        Frame(HEADER, JPEG), EdgeSettings.model_validate({"contour_min": 1} | changed)
    )


@pytest.mark.parametrize(
    "changed",
    [
        {},
        *({"sigma": value} for value in (0.0, 3.0)),
        *({"aperture": value} for value in (5, 7)),
        {"low": 90.0},
        {"high": 200.0},
        {"l2": False},
    ],
    ids=str,
)
def test_all_settings_of_canny_reach_it(changed: dict):
    numbers = {"sigma": 1.4, "low": 40.0, "high": 100.0, "aperture": 3, "l2": True} | changed
    gray = cv2.imdecode(np.frombuffer(JPEG, np.uint8), cv2.IMREAD_GRAYSCALE)
    found = edges_of(changed).edges
    assert np.array_equal(found, Canny(**numbers).detect(np.asarray(gray, np.uint8)).edges)
    assert np.array_equal(found, edges_of({}).edges) == (not changed)


@pytest.mark.parametrize(
    "changed",
    [
        {"detector": "haralick", "window": 7},
        {"detector": "laplacian_of_gaussian"},
        {"detector": "roberts", "sigma": 0.0},
        {"region": "20,30,60,40"},
        {"scale": 0.5},
        {"region": "100,60,500,500", "scale": 0.7},
    ],
    ids=str,
)
def test_every_result_has_the_size_of_the_frame(changed: dict):
    found = edges_of(changed)
    assert found.edges.shape == found.strength.shape == (120, 160)
    assert set(np.unique(found.edges)) <= {0, 255}
    assert {make().shape[:2] for make in found.stages.values()} == {(120, 160)}


def test_the_map_of_a_region_is_that_of_its_pixels():
    """But for its border, and without hysteresis, which follows lines out of it and back."""
    options = {"sigma": 0.0, "low": 100.0}
    whole, part = edges_of(options), edges_of({**options, "region": "20,30,60,40"})
    assert part.edges[32:68, 22:78].any()
    assert np.array_equal(part.edges[32:68, 22:78], whole.edges[32:68, 22:78])
    assert not part.edges[:30].any()
    assert not part.edges[:, 80:].any()
    assert part.density == pytest.approx(np.count_nonzero(part.edges) / (60 * 40))


def test_raw_pixels_are_converted_once_and_only_for_a_result(monkeypatch: pytest.MonkeyPatch):
    convert = Mock(wraps=pixel_formats.convert)
    monkeypatch.setattr(pixel_formats, "convert", convert)
    frame = Frame(HEADER, codecs.decode_jpeg(JPEG, "bgr8"))
    settings = EdgeSettings(detector="canny")
    decode_ahead(frame, settings)
    found = EdgesOfFrame(frame, settings)
    stages = found.stages
    assert not convert.called
    assert found.edges.any()
    assert stages["smoothed"]().any()
    assert [each.args[1:] for each in convert.call_args_list] == [("bgr8", "mono8")]


def test_a_corrupt_picture_is_refused_before_a_result_is_asked_for():
    with pytest.raises(PayloadError, match="corrupt"):
        EdgesOfFrame(Frame(HEADER, JPEG[: len(JPEG) // 2]), EdgeSettings())


def test_raw_pixels_without_the_region_are_refused_before_a_result_is_asked_for():
    frame = Frame(HEADER, np.zeros((120, 160, 3), np.uint8))
    with pytest.raises(PayloadError, match="region_outside"):
        EdgesOfFrame(frame, EdgeSettings(region="160,0,10,10"))


def test_the_message_has_the_lines_of_the_map():
    found = edges_of({"contours": 5, "circles": True})
    message = found.message(lambda: HEADER)
    assert 0 < len(message.contours) <= 5
    lengths = [line.length for line in message.contours]
    assert lengths == sorted(lengths, reverse=True)
    edges = found.edges
    assert all(edges[y, x] == 255 for line in message.contours for x, y in line.points)
    assert message.circles is not None
    assert Contours.from_bytes(message.to_bytes()) == message


def test_lengths_of_lines_are_in_pixels_of_the_frame_at_any_scale():
    """A bar of 40 x 40 pixels with a notch 4 deep; a line around it has 80 pixels at half scale."""
    picture = np.zeros((120, 160), np.uint8)
    picture[40:80, 60:100] = 200
    picture[40:44, 76:84] = 0
    frame = Frame(HEADER.model_copy(update={"encoding": "mono8"}), picture)

    def lines(**changed: object) -> Lines:
        options = {"sigma": 0.5, "scale": 0.5, "contour_min": 1} | changed
        return EdgesOfFrame(frame, EdgeSettings.model_validate(options)).lines

    longest = lines().polylines[0].length
    assert longest > 140
    assert lines(contour_min=int(longest * 0.9)).polylines
    assert not lines(contour_min=int(longest * 1.2)).polylines
    notched, smooth = (
        [point for line in lines(contour_tolerance=most).polylines for point in line.points]
        for most in (2.5, 5)
    )
    assert len(notched) > len(smooth)


@pytest.mark.parametrize(
    ("values", "words"),
    [
        ({"low": 120.0}, "low = 120 is above high = 100"),
        ({"aperture": 4}, "aperture"),
        ({"aperture": 9}, "aperture"),
        ({"sigma": -1.0}, "sigma"),
        ({"sigma": 0.3, "detector": "laplacian_of_gaussian"}, "sigma = 0.3 is too small"),
        ({"detector": "susan"}, "detector"),
        ({"window": 6}, "window"),
        ({"region": "1,2,3"}, "region"),
        ({"region": "0,0,0,10"}, "region"),
        ({"scale": 0.0}, "scale"),
        ({"format": "gif"}, "format"),
    ],
    ids=str,
)
def test_contradictory_settings_are_refused_with_the_reason(values: dict, words: str):
    with pytest.raises(ConfigurationError, match=words):
        load_settings(EdgeSettings, flags=values)


def test_a_mask_that_cannot_be_read_is_named(tmp_path: Path):
    path = tmp_path / "mask.png"
    with pytest.raises(SourceError, match="No such file"):
        read_mask(str(path))
    path.write_text("no image")
    with pytest.raises(SourceError, match="mask"):
        read_mask(str(path))
    path.write_bytes(codecs.encode_png(np.eye(4, dtype=np.uint8) * 9))
    mask = read_mask(str(path))
    assert mask is not None
    assert np.array_equal(mask, np.eye(4) * 255)
    assert read_mask(None) is None


def test_the_setting_names_every_detector_and_has_all_their_parameters():
    assert set(choices(EdgeSettings, "detector")) == set(DETECTORS)
    for name, kind in DETECTORS.items():
        assert isinstance(detector_named(name, EdgeSettings()), kind)


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
        found = EdgesOfFrame(Frame(header(width=WIDTH, height=HEIGHT), picture), settings)
        assert found.edges.any()
        for make in found.stages.values():
            make()
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert peak < int(stated[1]) * WIDTH * HEIGHT
