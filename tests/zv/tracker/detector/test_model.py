"""Models that cannot be used, and outputs that no model should have."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from tests.support import detector_models
from tests.support.detector_models import NAMES, SIZE, scene
from zenoh_vision.errors import ConfigurationError
from zv.tracker.detector import runtimes
from zv.tracker.detector.class_names import Wanted, check_known, name_of, names_in, read_names
from zv.tracker.detector.errors import UnknownLayout, UnusableModel
from zv.tracker.detector.model import Model, ModelOptions
from zv.tracker.detector.onnx_file import read_onnx
from zv.tracker.detector.opencv_runtime import SHAPING, OpenCvRuntime
from zv.tracker.detector.options import classes_of, size_of
from zv.tracker.detector.placement import placement
from zv.tracker.detector.suppression import MOST_BOXES, Candidates, suppressed

BOX = (8, 8, 24, 40)


def model_of(tmp_path: Path, form: str = "yolov8", **options: Any) -> Model:
    path = detector_models.save(tmp_path / "tiny.onnx", form)
    return Model(ModelOptions(str(path), **options))


def found_in(model: Model, picture: NDArray[np.uint8], least: float = 0.4):
    prepared = model.prepared(picture.shape[1::-1], lambda *_: picture)
    return model.detect([prepared], least, 0.6)[0]


# Size, batch, device


def test_a_size_that_the_file_does_not_fix_must_be_given(tmp_path: Path):
    path = str(detector_models.save(tmp_path / "tiny.onnx", "yolov8", dynamic=True))
    with pytest.raises(UnknownLayout, match="--input-size, such as 640x640"):
        Model(ModelOptions(path))
    model = Model(ModelOptions(path, input_size=(SIZE, SIZE)))
    assert [each.name for each in found_in(model, scene({2: BOX})).detections] == ["blue"]


def test_a_size_that_the_file_does_not_fix_is_taken_from_its_metadata(tmp_path: Path):
    metadata = {"imgsz": "[64, 64]", "names": str(NAMES)}
    path = tmp_path / "tiny.onnx"
    detector_models.save(path, "yolov8", dynamic=True, metadata=metadata)
    assert Model(ModelOptions(str(path))).size == (64, 64)


@pytest.mark.parametrize("size", ["[0, 0]", "[-64, 64]", "[1e400, 64]", "[64]", "64"])
def test_a_size_in_the_metadata_that_is_none_must_be_given(size: str, tmp_path: Path):
    path = tmp_path / "tiny.onnx"
    detector_models.save(path, "yolov8", dynamic=True, metadata={"imgsz": size})
    with pytest.raises(UnknownLayout, match="--input-size, such as 640x640"):
        Model(ModelOptions(str(path)))


def test_a_size_that_contradicts_the_file_is_refused(tmp_path: Path):
    with pytest.raises(ConfigurationError, match="an input of 64x64, which is fixed"):
        model_of(tmp_path, input_size=(640, 640))


@pytest.mark.parametrize("runtime", ["opencv", "onnxruntime"])
def test_pictures_of_several_cameras_are_seen_at_once_if_the_model_allows_it(
    runtime: str, tmp_path: Path
):
    path = str(detector_models.save(tmp_path / "tiny.onnx", "yolov8", dynamic=True))
    model = Model(ModelOptions(path, input_size=(SIZE, SIZE), runtime=runtime))
    assert model.most > 1
    pictures = [scene({0: BOX}), scene({}), scene({1: BOX, 2: (40, 40, 50, 60)}, (128, 64))]
    prepared = [model.prepared(each.shape[1::-1], lambda *_, p=each: p) for each in pictures]
    found = model.detect(prepared, 0.4, 0.6)
    names = [[each.name for each in one.detections] for one in found]
    assert names == [["red"], [], ["green", "blue"]]
    assert found[0].detections[0].box == pytest.approx(BOX, abs=0.01)


def test_a_device_that_is_not_there_is_refused_with_those_that_are(tmp_path: Path):
    with pytest.raises(ConfigurationError, match=r"device = coreml is not there; .* has: cpu"):
        model_of(tmp_path, device="coreml", runtime="onnxruntime")


def test_a_device_needs_onnx_runtime(tmp_path: Path):
    with pytest.raises(ConfigurationError, match=r"device = cuda needs ONNX Runtime"):
        model_of(tmp_path, device="cuda", runtime="opencv")


def test_without_onnx_runtime_opencv_runs_a_model(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(runtimes, "has_onnxruntime", lambda: False)
    assert model_of(tmp_path).words == "tiny.onnx by OpenCV on cpu"
    with pytest.raises(ConfigurationError, match="pip install"):
        model_of(tmp_path, runtime="onnxruntime")


@pytest.mark.parametrize("operator", [None, *sorted(SHAPING)])
def test_opencv_s_older_engine_gets_no_model_that_computes_sides(
    operator: str | None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    """It ended the process with torchvision's SSDLite, and cut what NonMaxSuppression returned."""
    file = read_onnx(detector_models.save(tmp_path / "tiny.onnx", "yolov8"))
    file = replace(file, operators=file.operators | ({operator} if operator else set()))
    engines: list[int] = []
    read = cv2.dnn.readNetFromONNX

    def noting(path: str, engine: int) -> cv2.dnn.Net:
        engines.append(engine)
        return read(path, engine)

    monkeypatch.setattr(cv2.dnn, "readNetFromONNX", noting)
    OpenCvRuntime(file, {"images": np.zeros((1, 3, SIZE, SIZE), np.float32)}, 1)
    older = [] if operator else [cv2.dnn.ENGINE_CLASSIC]
    assert engines == [*older, cv2.dnn.ENGINE_NEW]


# What cannot be run


def test_an_operator_that_nobody_knows_is_named_with_what_does_not_know_it(tmp_path: Path):
    path = detector_models.save(tmp_path / "tiny.onnx", "yolov8", operator="Frobnicate")
    with pytest.raises(UnusableModel) as refused:
        Model(ModelOptions(str(path)))
    text = str(refused.value)
    assert "ONNX Runtime cannot run the operator Frobnicate" in text
    assert "OpenCV cannot run the operator Frobnicate" in text


def test_without_onnx_runtime_an_unknown_operator_names_the_extra(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr(runtimes, "has_onnxruntime", lambda: False)
    path = detector_models.save(tmp_path / "tiny.onnx", "yolov8", operator="Frobnicate")
    with pytest.raises(UnusableModel, match=r"ONNX Runtime may: pip install"):
        Model(ModelOptions(str(path)))


# Outputs


class Says:
    """A runtime with outputs of its own."""

    name, device = "test", "cpu"

    def __init__(self, columns: NDArray[np.float32]) -> None:
        self.columns = columns

    def run(self, _: object) -> dict[str, NDArray[np.float32]]:
        return {"output0": self.columns[None]}


def model_that_says(columns: NDArray[np.float32], tmp_path: Path) -> Model:
    model = model_of(tmp_path)
    model.runtime = Says(columns)
    return model


def test_boxes_with_nan_are_left_out_and_counted(tmp_path: Path):
    columns = np.zeros((7, 84), np.float32)
    columns[:4, :4] = np.array([[20, 20, 10, 10]]).T
    columns[4, :4] = 0.9
    columns[2, 1], columns[4, 2], columns[0, 3] = np.nan, np.nan, np.inf
    found = found_in(model_that_says(columns, tmp_path), scene({}))
    assert (len(found.detections), found.not_finite) == (1, 3)


def test_huge_and_infinite_numbers_of_a_box_are_computed_without_a_warning(tmp_path: Path):
    columns = np.zeros((7, 84), np.float32)
    columns[:4, :3] = np.array([[20, 20, 10, 10]]).T
    columns[4, :3] = 0.9
    columns[2, 1], columns[0, 1] = np.inf, np.inf  # its left is infinite minus infinite
    columns[2, 2], columns[3, 2] = 3e38, 3e38  # in the larger picture this is no float32
    found = found_in(model_that_says(columns, tmp_path), scene({}, (400, 400)))
    assert [each.box for each in found.detections] == [
        (93.75, 93.75, 156.25, 156.25),
        (0, 0, 400, 400),
    ]
    assert found.not_finite == 1


def test_ten_thousand_boxes_are_bounded_and_counted(tmp_path: Path):
    generator = np.random.default_rng(1)
    columns = np.zeros((7, 10_000), np.float32)
    columns[:2] = generator.uniform(4, 60, (2, 10_000))
    columns[2:4] = 3
    columns[4] = generator.uniform(0.5, 1, 10_000)
    found = found_in(model_that_says(columns, tmp_path), scene({}))
    assert len(found.detections) == MOST_BOXES
    assert found.left_out >= 10_000 - 2000
    scores = [each.score for each in found.detections]
    assert scores == sorted(scores, reverse=True)


def test_boxes_are_cut_at_the_borders_and_those_outside_are_left_out(tmp_path: Path):
    columns = np.zeros((7, 84), np.float32)
    columns[:5, 0] = (0, 32, 20, 8, 0.9)
    columns[:5, 1] = (-50, 32, 20, 8, 0.9)
    found = found_in(model_that_says(columns, tmp_path), scene({}))
    assert [each.box for each in found.detections] == [pytest.approx((0, 28, 10, 36))]


def test_suppression_is_by_class_and_one_object_has_one_class():
    boxes = np.array([[0, 0, 10, 10], [0, 0, 10, 10], [0, 0, 10, 8], [0, 0, 10, 7]], np.float32)
    scores = np.array([0.9, 0.8, 0.7, 0.6], np.float32)
    found = suppressed(Candidates(boxes, scores, np.array([0, 1, 0, 2])), 0.6)
    # The second is the first as another class; the third shares 80 % of its union with the first,
    # which is of its class; the fourth shares 70 %, but is of another class.
    assert found.scores.tolist() == pytest.approx([0.9, 0.6])


@pytest.mark.parametrize(
    ("fit", "size", "left", "top"),
    [
        ("centre", (640, 360), 0, 140),
        ("corner", (640, 360), 0, 0),
        ("stretch", (640, 640), 0, 0),
    ],
)
def test_a_picture_is_placed_by_the_fit(fit: Any, size: tuple[int, int], left: int, top: int):
    place = placement((1920, 1080), (640, 640), fit)
    assert (place.size, place.left, place.top) == (size, left, top)
    canvas = place.drawn(np.full((1080, 1920, 3), 255, np.uint8))
    assert canvas.shape == (640, 640, 3)
    assert int((canvas == 255).all(axis=2).sum()) == size[0] * size[1]
    box = np.array([[left, top, left + size[0], top + size[1]]], np.float32)
    assert place.in_picture(box).tolist() == [[0, 0, 1920, 1080]]


# Names


@pytest.mark.parametrize(
    "text",
    ["{0: 'person', 1: 'traffic light'}", '["person", "traffic light"]', "person, traffic light"],
    ids=["Ultralytics", "JSON", "commas"],
)
def test_names_in_the_metadata_are_read(text: str):
    assert names_in({"names": text}) == {0: "person", 1: "traffic light"}


def test_names_in_the_metadata_may_be_lines_under_another_key():
    assert names_in({"character": "text\ntitle"}) == {0: "text", 1: "title"}


def test_a_name_cannot_control_a_terminal_or_separate_classes():
    assert names_in({"names": str({0: "a\x1b[31m,b"})}) == {0: "a [31m b"}
    assert name_of({}, 7) == "7"


def test_names_of_a_file_win_and_an_empty_line_is_a_class(tmp_path: Path):
    file = tmp_path / "names.txt"
    file.write_text("rot\n\nblau\n")
    assert read_names(str(file)) == {0: "rot", 2: "blau"}
    model = model_of(tmp_path, class_names=str(file))
    found = found_in(model, scene({1: (2, 2, 30, 30), 2: (34, 34, 60, 60)}))
    assert [each.name for each in found.detections] == ["1", "blau"]


@pytest.mark.parametrize(
    "layout", ["yolov5", "yolov8", "yolox", "rtdetr", "detr"]
)  # the outputs of the others do not tell how many classes there are
def test_a_file_with_more_names_than_the_model_has_classes_is_refused(layout: str, tmp_path: Path):
    file = tmp_path / "names.txt"
    file.write_text("red\ngreen\nblue\n")
    assert model_of(tmp_path, layout, layout=layout, class_names=str(file)).names == NAMES
    file.write_text("background\nred\ngreen\nblue\n")
    with pytest.raises(
        ConfigurationError, match=r"names\.txt: 4 lines for the 3 classes that .*tiny"
    ):
        model_of(tmp_path, layout, layout=layout, class_names=str(file))


@pytest.mark.parametrize("inside", ["\x0c", "\x85", "\u2028", "\x1c"])
def test_a_name_ends_only_at_the_end_of_its_line(inside: str, tmp_path: Path):
    file = tmp_path / "names.txt"
    file.write_text(f"rot{inside}\r\nblau\r\n", encoding="utf-8")
    assert read_names(str(file)) == {0: "rot", 1: "blau"}


def test_a_class_that_the_model_does_not_have_is_refused_with_a_suggestion():
    wanted = Wanted(0.5, classes_of("person, cra:0.4"))
    with pytest.raises(ConfigurationError, match=r"no class 'cra'; did you mean 'car'\?.* car"):
        check_known(wanted, {0: "person", 1: "car"})
    with pytest.raises(ConfigurationError, match="--class-names"):
        check_known(wanted, {})


def test_each_class_may_have_a_least_score_of_its_own():
    wanted = Wanted(0.5, classes_of("person:0.8, car"))
    scores = [wanted.score_of(name) for name in ("person", "car", "dog")]
    assert scores == [0.8, 0.5, None]
    assert Wanted(0.5).score_of("dog") == 0.5


@pytest.mark.parametrize("text", ["person:2", "person:x", ":0.5", "car,car"])
def test_wrong_classes_are_refused(text: str):
    with pytest.raises(ValueError, match=r"score|stand|twice"):
        classes_of(text)


@pytest.mark.parametrize("text", ["640", "640x", "0x640", "640*640", "99999x1"])
def test_wrong_sizes_are_refused(text: str):
    with pytest.raises(ValueError, match="WIDTHxHEIGHT"):
        size_of(text)
