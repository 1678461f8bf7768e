"""Models of each layout, run by both runtimes, and the outputs of published models."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.support import detector_models
from tests.support.detector_models import FORMS, NAMES, SCORES, scene
from zv.tracker.detector import decoding
from zv.tracker.detector.decoding import Facts
from zv.tracker.detector.errors import UnknownLayout
from zv.tracker.detector.layouts import LAYOUTS, recognised
from zv.tracker.detector.model import Found, Model, ModelOptions
from zv.tracker.detector.onnx_file import OnnxFile, Tensor

BOXES = {0: (10, 7, 30, 21), 1: (36, 5, 60, 27), 2: (12, 40, 23, 56)}
"""Left, top, right, bottom of what is red, green and blue."""


def detected(model: Model, picture: NDArray[np.uint8]) -> Found:
    prepared = model.prepared(picture.shape[1::-1], lambda *_: picture)
    return model.detect([prepared], 0.4, 0.6)[0]


def test_each_layout_has_a_model_in_these_tests():
    assert set(FORMS) == set(LAYOUTS)


@pytest.mark.parametrize("runtime", ["opencv", "onnxruntime"])
@pytest.mark.parametrize("layout", FORMS)
def test_a_model_is_recognised_and_finds_boxes_to_the_pixel(
    layout: str, runtime: str, tmp_path: Path
):
    path = detector_models.save(tmp_path / "tiny.onnx", layout)
    model = Model(ModelOptions(str(path), runtime=runtime))
    found = detected(model, scene(BOXES))
    assert model.layout == layout
    assert path.stat().st_size < 5000
    assert [each.name for each in found.detections] == list(NAMES.values())
    for each, score in zip(found.detections, SCORES, strict=True):
        assert each.box == pytest.approx(BOXES[each.number], abs=0.01)
        assert each.score == pytest.approx(score, abs=1e-3)


@pytest.mark.parametrize(
    ("layout", "box"),
    [
        # 128x64 in 64x64: scaled by 1/2. With equal margins there are 16 rows above; a box of even
        # coordinates falls on whole pixels of the input, and comes back as it was.
        ("yolov8", (40, 10, 80, 40)),
        ("yolox", (40, 10, 80, 40)),
        ("rtdetr", (40, 10, 80, 40)),
    ],
    ids=["centre", "corner", "stretch"],
)
def test_boxes_are_mapped_back_from_the_input_to_a_picture_of_another_shape(
    layout: str, box: tuple[int, int, int, int], tmp_path: Path
):
    model = Model(ModelOptions(str(detector_models.save(tmp_path / "tiny.onnx", layout))))
    [found] = detected(model, scene({1: box}, (128, 64))).detections
    assert (found.name, found.box) == ("green", pytest.approx(box, abs=1.0))


def file_with(
    outputs: Mapping[str, tuple[int, ...]],
    inputs: tuple[str, ...] = ("images",),
    **metadata: str,
) -> OnnxFile:
    tensors = tuple(Tensor(name, "float32", shape) for name, shape in outputs.items())
    return OnnxFile(
        Path("model.onnx"),
        tuple(Tensor(name, "float32", (1, 3, 640, 640)) for name in inputs),
        tensors,
        metadata,
        frozenset(),
    )


def of_grids(rows: tuple[int, ...], scores: str, sides: str, width: int = 32) -> dict:
    """Return the shapes of two outputs for each grid, all scores first, as they are published."""
    return {scores.format(each): (1, each, 80) for each in rows} | {
        sides.format(each): (1, each, width) for each in rows
    }


PUBLISHED = {
    "YOLOv5n": ("yolov5", 640, {"output0": (1, 25200, 85)}, 80),
    "YOLOv5n6": ("yolov5", 1280, {"output0": (1, 102000, 85)}, 80),
    "YOLOv5 of one class": ("yolov5", 640, {"output0": (1, 25200, 6)}, 1),
    "YOLOv5, older": (
        "yolov5",
        640,
        {"output": (1, 25200, 85), "345": (1, 3, 80, 80, 85), "403": (1, 3, 40, 40, 85)},
        0,
    ),
    "YOLOv6n": ("yolov5", 640, {"outputs": (1, 8400, 85)}, 0),
    "YOLOv7": ("yolov5", 640, {"output": (1, 25200, 85)}, 0),
    "YOLOv7, suppression": ("yolo_nms", 640, {"output": (23, 7)}, 0),
    "YOLOv8n, YOLO11n": ("yolov8", 640, {"output0": (1, 84, 8400)}, 80),
    "YOLOv8n-seg": ("yolov8", 640, {"output0": (1, 116, 8400), "output1": (1, 32, 160, 160)}, 80),
    "YOLOv8 of one class": ("yolov8", 640, {"output0": (1, 5, 8400)}, 1),
    "YOLOv10n, YOLO11n nms=True": ("yolo_nms", 640, {"output0": (1, 300, 6)}, 80),
    "YOLO for TensorRT": (
        "yolo_nms",
        640,
        {
            "num_dets": (1, 1),
            "det_boxes": (1, 100, 4),
            "det_scores": (1, 100),
            "det_classes": (1, 100),
        },
        0,
    ),
    "YOLOX-tiny": ("yolox", 416, {"output": (1, 3549, 85)}, 0),
    "YOLOX of 3 classes": ("yolox", 640, {"output": (1, 8400, 8)}, 3),
    "NanoDet-m": ("nanodet", 320, {"output": (1, 2100, 112)}, 0),
    "NanoDet-Plus-m": ("nanodet", 320, {"output": (1, 2125, 112)}, 0),
    "NanoDet-Plus-m 416": ("nanodet", 416, {"output": (1, 3598, 112)}, 0),
    "NanoDet-m of 2020": (
        "nanodet",
        320,
        of_grids((1600, 400, 100), "cls_pred_{}", "dis_pred_{}"),
        0,
    ),
    "PicoDet": ("nanodet", 416, of_grids((2704, 676, 169, 49), "scores_{}", "boxes_{}"), 0),
    "RT-DETR-l, Ultralytics": ("rtdetr", 640, {"output0": (1, 300, 84)}, 80),
    "RT-DETR, Transformers": ("detr", 640, {"logits": (1, 300, 80), "pred_boxes": (1, 300, 4)}, 0),
    "RF-DETR": ("detr", 560, {"dets": (1, 300, 4), "labels": (1, 300, 91)}, 0),
    "SSD, TensorFlow": (
        "ssd",
        300,
        {
            "detection_boxes": (1, 100, 4),
            "detection_classes": (1, 100),
            "detection_scores": (1, 100),
            "num_detections": (1,),
        },
        0,
    ),
    "SSD, ONNX zoo": (
        "ssd",
        1200,
        {"bboxes": (1, 200, 4), "labels": (1, 200), "scores": (1, 200)},
        0,
    ),
    "SSD, OpenVINO": ("ssd", 300, {"detection_out": (1, 1, 200, 7)}, 0),
    "SSDLite, torchvision": (
        "torchvision",
        320,
        {"boxes": (3, 4), "scores": (3,), "labels": (3,)},
        0,
    ),
}


@pytest.mark.parametrize(("layout", "size", "shapes", "classes"), PUBLISHED.values(), ids=PUBLISHED)
def test_the_layouts_of_published_models_are_recognised(
    layout: str, size: int, shapes: dict[str, tuple[int, ...]], classes: int
):
    assert recognised(file_with(shapes), shapes, (size, size), classes) == layout


def test_d_fine_is_recognised_by_the_input_that_asks_for_the_size():
    shapes = {"labels": (1, 300), "boxes": (1, 300, 4), "scores": (1, 300)}
    file = file_with(shapes, ("images", "orig_target_sizes"))
    assert recognised(file, shapes, (640, 640), 0) == "dfine"


def test_rt_detr_of_two_classes_is_told_from_built_in_suppression_by_its_metadata():
    shapes = {"output0": (1, 300, 6)}
    assert recognised(file_with(shapes), shapes, (640, 640), 2) == "yolo_nms"
    named = file_with(shapes, description="Ultralytics rtdetr-l model")
    assert recognised(named, shapes, (640, 640), 2) == "rtdetr"


@pytest.mark.parametrize(
    "shapes",
    [
        {"heat": (1, 80, 128, 128)},
        {"output": (1, 8400, 60)},  # YOLOX of 55 classes, or NanoDet of 28
        {"a": (1, 100, 5), "b": (1, 100, 5)},
        of_grids((6400, 1600, 400), "score_{}", "box_{}", width=4),
        of_grids((6400, 1600), "class_{}", "box_{}"),
    ],
    ids=["heat map", "two layouts fit", "two outputs", "distances without bins", "two grids"],
)
def test_an_unknown_layout_is_refused_with_names_shapes_and_what_can_be_named(
    shapes: dict[str, tuple[int, ...]],
):
    with pytest.raises(UnknownLayout) as refused:
        recognised(file_with(shapes), shapes, (640, 640), 0)
    text = str(refused.value)
    for name, shape in shapes.items():
        assert f"{name} {list(shape)}" in text
    assert "images float32 [1, 3, 640, 640]" in text
    assert all(f"{name} ({layout.words})" in text for name, layout in LAYOUTS.items())
    assert text.isprintable()  # else its lines would be escaped where it is shown


@pytest.mark.parametrize("task", ["obb", "classify"])
def test_a_model_of_another_task_is_refused_by_its_metadata(task: str):
    shapes = {"output0": (1, 20, 8400)}
    with pytest.raises(UnknownLayout, match=task):
        recognised(file_with(shapes, task=task), shapes, (640, 640), 0)


def test_a_layout_that_does_not_fit_the_outputs_is_refused(tmp_path: Path):
    path = detector_models.save(tmp_path / "tiny.onnx", "yolov8")
    with pytest.raises(UnknownLayout, match=r"do not fit --layout yolox .* output0 \[1, 7, 84\]"):
        Model(ModelOptions(str(path), layout="yolox"))


def test_ssd_with_a_float_input_needs_the_range_of_its_numbers(tmp_path: Path):
    path = detector_models.save(tmp_path / "tiny.onnx", "yolov8", outputs=["detection_boxes"])
    with pytest.raises(UnknownLayout, match="--values: 0-1, 0-255, signed, imagenet"):
        Model(ModelOptions(str(path), layout="ssd"))


# Outputs by hand, in the form of a published model


def test_yolov7_rows_hold_the_picture_first_and_the_score_last():
    rows = np.array([[0, 10, 20, 30, 40, 2, 0.9], [0, 1, 2, 3, 4, 5, 0.1]], np.float32)
    found = decoding.finished({"output": rows}, Facts((64, 64)), 0.5)
    assert found.boxes.tolist() == [[10, 20, 30, 40]]
    assert (found.classes.tolist(), found.scores.tolist()) == ([2], pytest.approx([0.9]))


def test_outputs_for_tensorrt_end_with_the_number_of_boxes():
    outputs = {
        "num_dets": np.array([1], np.float32),
        "det_boxes": np.array([[1, 2, 3, 4], [5, 6, 7, 8]], np.float32),
        "det_scores": np.array([0.9, 0.9], np.float32),
        "det_classes": np.array([3, 4], np.float32),
    }
    found = decoding.finished(outputs, Facts((64, 64)), 0.5)
    assert (found.boxes.tolist(), found.classes.tolist()) == ([[1, 2, 3, 4]], [3])


def test_rows_of_openvino_end_at_the_first_without_a_picture():
    rows = np.array([[[0, 15, 0.8, 0.25, 0.5, 0.75, 1.0], [-1, 0, 0, 0, 0, 0, 0]]], np.float32)
    found = decoding.shares({"detection_out": rows}, Facts((200, 100)), 0.5)
    assert (found.boxes.tolist(), found.classes.tolist()) == ([[50, 50, 150, 100]], [15])


def test_scores_of_each_class_begin_with_the_background():
    outputs = {
        "scores": np.array([[0.2, 0.1, 0.7], [0.9, 0.05, 0.05]], np.float32),
        "boxes": np.array([[0.1, 0.2, 0.3, 0.4], [0, 0, 1, 1]], np.float32),
    }
    found = decoding.shares(outputs, Facts((100, 100)), 0.5)
    assert (found.boxes[0].tolist(), found.classes.tolist()) == (
        pytest.approx([10, 20, 30, 40]),
        [2],
    )


def test_yolox_cells_count_from_the_finest_grid_along_its_rows():
    # Of 64x64 the fine grid has 8x8 cells of 8 pixels; cell 10 is column 2, row 1. Its centre is
    # moved by half a cell, and its sides are e^0 and e^(log 2) cells: 8 and 16 pixels.
    rows = np.zeros((84, 6), np.float32)
    rows[10] = (0.5, 0.5, 0, np.log(2), 0.9, 1)
    found = decoding.grid({"output": rows}, Facts((64, 64)), 0.5)
    assert found.boxes[0].tolist() == pytest.approx([16, 4, 24, 20])


def test_nanodet_plus_measures_from_the_corner_of_its_cell():
    # Of 64x64 there are four grids, 8x8 + 4x4 + 2x2 + 1; row 64 + 5 is column 1, row 1 of those of
    # 16 pixels: corner 16, 16. All weight is in the bins 1, 0, 2, 1: 16, 0, 32 and 16 pixels.
    rows = np.full((85, 33), -50, np.float32)
    rows[:, 0] = 0
    rows[69, 0] = 0.9
    for side, number in enumerate((1, 0, 2, 1)):
        rows[69, 1 + 8 * side + number] = 50
    found = decoding.distances({"output": rows}, Facts((64, 64), classes=1), 0.5)
    assert found.boxes[0].tolist() == pytest.approx([0, 16, 48, 32])


@pytest.mark.parametrize(("grids", "names"), [((64, 16, 4), 80), ((64, 16, 4, 1), 0)])
def test_nanodet_with_two_outputs_for_each_grid_measures_from_the_centre(
    grids: tuple[int, ...], names: int
):
    # Of 64x64; cell 5 of the grid of 16 pixels is column 1, row 1, so its centre is 24, 24. All
    # weight is in the bins 1, 0, 1, 2: 16, 0, 16 and 32 pixels.
    outputs = {f"scores {each}": np.zeros((each, 2), np.float32) for each in grids}
    outputs |= {f"sides {each}": np.full((each, 32), -50, np.float32) for each in grids}
    outputs["scores 16"][5, 1] = 0.9
    for side, number in enumerate((1, 0, 1, 2)):
        outputs["sides 16"][5, 8 * side + number] = 50
    found = decoding.distances(outputs, Facts((64, 64), names), 0.5)
    assert found.boxes.tolist() == [pytest.approx([8, 24, 40, 56])]
    assert (found.classes.tolist(), found.scores.tolist()) == ([1], pytest.approx([0.9]))


def test_rows_of_masks_are_not_taken_for_classes():
    columns = np.zeros((4 + 2 + 32, 84), np.float32)
    columns[:4, 3] = (20, 20, 10, 10)
    columns[5, 3], columns[6:, 3] = 0.8, 9.0
    found = decoding.columns({"output0": columns}, Facts((64, 64), classes=2), 0.5)
    assert (found.classes.tolist(), found.scores.tolist()) == ([1], pytest.approx([0.8]))
