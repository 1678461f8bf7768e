"""The layouts of models' outputs: how each is recognised, decoded, and what its input is like."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

from zv.tracker.detector import decoding
from zv.tracker.detector.decoding import Facts, Outputs, Shapes, cells, heads
from zv.tracker.detector.errors import UnknownLayout
from zv.tracker.detector.onnx_file import OnnxFile
from zv.tracker.detector.options import Colours, Fit, LayoutName, Values
from zv.tracker.detector.suppression import Candidates

MOST_QUERIES: Final = 1000
"""More rows than this are cells of grids, fewer are objects that the model chose itself."""


@dataclass(frozen=True, slots=True)
class Layout:
    """What the outputs of a family of models mean, and what its input is like."""

    words: str  # the models and the form of the outputs
    # Turns the outputs for one picture into boxes.
    decode: Callable[[Outputs, Facts, float], Candidates]
    fit: Fit  # how a picture is placed in the input
    colours: Colours  # order of the input's channels
    values: Values | None  # range of the input's numbers; None if models differ
    suppress: bool = False  # whether the model leaves boxes that show an object once more


LAYOUTS: Final[dict[LayoutName, Layout]] = {
    "yolov5": Layout(
        "YOLOv5, v6, v7: (n, 5 + classes)", decoding.objectness, "centre", "rgb", "0-1", True
    ),
    "yolov8": Layout(
        "YOLOv8, 11: (4 + classes, n)", decoding.columns, "centre", "rgb", "0-1", True
    ),
    "yolo_nms": Layout(
        "YOLO with built-in suppression, YOLOv10: (n, 6), (n, 7) or num_dets and det_...",
        decoding.finished,
        "centre",
        "rgb",
        "0-1",
    ),
    "yolox": Layout(
        "YOLOX: (n, 5 + classes), not decoded", decoding.grid, "corner", "bgr", "0-255", True
    ),
    "nanodet": Layout(
        "NanoDet, NanoDet-Plus, PicoDet: (n, classes + 32), or both apart for each grid",
        decoding.distances,
        "stretch",
        "bgr",
        "imagenet",
        True,
    ),
    "rtdetr": Layout(
        "RT-DETR by Ultralytics: (n, 4 + classes)", decoding.queries, "stretch", "rgb", "0-1"
    ),
    "detr": Layout(
        "RT-DETR, D-FINE, RF-DETR: logits and boxes", decoding.logits, "stretch", "rgb", "0-1"
    ),
    "dfine": Layout(
        "D-FINE, RT-DETR by their authors: labels, boxes, scores",
        decoding.labelled,
        "stretch",
        "rgb",
        "0-1",
    ),
    "ssd": Layout(
        "SSD: boxes, scores and classes, or (n, 7)", decoding.shares, "stretch", "rgb", None, True
    ),
    "torchvision": Layout(
        "torchvision: boxes (n, 4), labels, scores", decoding.labelled, "stretch", "rgb", "0-1"
    ),
}


def recognised(file: OnnxFile, shapes: Shapes, size: tuple[int, int], classes: int) -> LayoutName:
    """Return the layout of a model.

    Args:
        file: What its file says.
        shapes: The shapes of its outputs for one picture, with the dimension of the batch.
        size: Width and height of its input.
        classes: Number of its classes; 0 if that is unknown.

    Raises:
        UnknownLayout: Names inputs and outputs, and the layouts that can be named.
    """
    task = file.metadata.get("task", "detect")
    if task in ("classify", "obb"):
        raise UnknownLayout(
            f"{file.path}: a model of the task {task!r}; allowed: models that find upright boxes"
        )
    found = _by_names(file, shapes) or _by_shape(file, shapes, size, classes)
    if found is None:
        outputs = "; ".join(f"{name} {list(shape)}" for name, shape in shapes.items())
        inputs = "; ".join(map(str, file.inputs))
        known = "; ".join(f"{name} ({layout.words})" for name, layout in LAYOUTS.items())
        raise UnknownLayout(
            f"{file.path}: the layout is not known by names and shapes. inputs: {inputs}; "
            f"outputs: {outputs}. If it is one of these, name it with --layout: {known}"
        )
    return found


def _by_names(file: OnnxFile, shapes: Shapes) -> LayoutName | None:
    names = [name.lower() for name in shapes]

    def has(*words: str) -> bool:
        return any(word in name for name in names for word in words)

    found: LayoutName | None = None
    if {"num_dets", "det_boxes", "det_scores", "det_classes"} <= set(names):
        found = "yolo_nms"
    elif has("detection_boxes") and has("detection_scores") and has("detection_classes"):
        found = "ssd"
    elif (has("logits") and has("boxes")) or {"dets", "labels"} == set(names):
        found = "detr"
    elif all(sum(word in name for name in names) == 1 for word in ("box", "score")):
        boxes = next(shape for name, shape in shapes.items() if "box" in name.lower())
        if any("target_sizes" in each.name for each in file.inputs):
            found = "dfine"
        else:
            found = "torchvision" if len(boxes) == 2 else "ssd"
    return found


def _by_shape(
    file: OnnxFile, shapes: Shapes, size: tuple[int, int], classes: int
) -> LayoutName | None:
    """Return the layout of one output; further ones may be masks or grids before decoding."""
    if any(len(shape) == 2 and shape[1] == 7 for shape in shapes.values()):
        return "yolo_nms"
    if any(len(shape) == 4 and shape[1] == 1 and shape[3] == 7 for shape in shapes.values()):
        return "ssd"
    three = {name: shape for name, shape in shapes.items() if len(shape) == 3}
    grids = heads(three, size)
    if grids and all(three[sides][2] == 32 for _, sides in grids):
        return "nanodet"
    if len(three) != 1:
        return None
    [(name, (_, rows, width))] = three.items()
    if rows in (3 * cells(size), 3 * cells(size, (8, 16, 32, 64))) and width > 5:
        return "yolov5"
    if rows == cells(size) and width > 5:
        return _of_grid(name, width, classes)
    if rows == cells(size, (8, 16, 32, 64)) and width > 32:
        return "nanodet"
    if width in (cells(size), cells(size, (8, 16, 32, 64))) and rows > 4:
        return "yolov8"
    if rows <= MOST_QUERIES and width > 4:
        detr = any(word in str(file.metadata).lower() for word in ("rtdetr", "rt-detr"))
        return "yolo_nms" if width == 6 and not detr else "rtdetr" if width > 6 or detr else None
    return None


def _of_grid(name: str, width: int, classes: int) -> LayoutName | None:
    """Return which models with one row for each cell have rows of this width."""
    if name == "outputs":  # YOLOv6 decodes its boxes itself, and has an objectness of 1
        return "yolov5"
    if classes and width in (classes + 5, classes + 32):
        return "yolox" if width == classes + 5 else "nanodet"
    if classes or (width > 33 and width not in (85, 112)):  # 85 and 112 are those of COCO
        return None
    return "nanodet" if width == 112 else "yolox"
