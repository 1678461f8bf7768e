"""Builds tiny detectors, a few kB of ONNX: they find what is red, green and blue, to the pixel.

The graph marks the pixels of each colour, and reads the box from the first and last marked column
and row. It ends in the form of a family of models, so that a test decodes what such a model says.
"""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from functools import cache
from math import ceil
from pathlib import Path

import numpy as np
import onnx
import onnxruntime
from numpy.typing import NDArray
from onnx import TensorProto, helper, numpy_helper

SIZE = 64
"""Width and height of the input."""

CELLS = 8 * 8 + 4 * 4 + 2 * 2
"""Of the grids with 8, 16 and 32 pixels a cell."""

NAMES = {0: "red", 1: "green", 2: "blue"}
SCORES = (0.9, 0.8, 0.7)
COLOURS = ((0, 0, 255), (0, 255, 0), (255, 0, 0))
"""Of the classes, BGR."""

MEAN, DEVIATION = np.array([0.485, 0.456, 0.406]), np.array([0.229, 0.224, 0.225])


def scene(
    boxes: Mapping[int, tuple[int, int, int, int]], size: tuple[int, int] = (SIZE, SIZE)
) -> NDArray[np.uint8]:
    """Return a grey picture, BGR, with a box (left, top, right, bottom) of each class."""
    picture = np.full((size[1], size[0], 3), 100, np.uint8)
    for number, (left, top, right, bottom) in boxes.items():
        picture[top:bottom, left:right] = COLOURS[number]
    return picture


class Graph:
    """An ONNX graph in the making."""

    def __init__(self) -> None:
        self.nodes: list[onnx.NodeProto] = []
        self.weights: list[onnx.TensorProto] = []

    def constant(self, values: object, dtype: type = np.float32) -> str:
        name = f"c{len(self.weights)}"
        self.weights.append(numpy_helper.from_array(np.array(values, dtype), name))
        return name

    def node(self, operator: str, *inputs: str, name: str = "", **attributes: object) -> str:
        name = name or f"n{len(self.nodes)}"
        self.nodes.append(helper.make_node(operator, inputs, [name], **attributes))
        return name


def save(
    path: Path,
    layout: str,
    *,
    size: int = SIZE,
    dynamic: bool = False,
    metadata: Mapping[str, str] | None = None,
    operator: str = "",
    outputs: Sequence[str] = (),
    takes_s: float = 0,
) -> Path:
    """Write a model of a layout, whose classes are those of ``NAMES``.

    Args:
        path: The file.
        layout: Name of the layout.
        size: Width and height of its input.
        dynamic: Whether the number of pictures, width and height are not fixed in the file.
        metadata: Texts in it; by default the names of its classes.
        operator: An operator that is put before the first output, such as one that nobody knows.
        outputs: Other names of the outputs.
        takes_s: CPU time that one thread takes for a picture, on this machine.
    """
    graph = Graph()
    side = "S" if dynamic else size
    batch = "N" if dynamic else 1
    shape: list[object] = [batch, 3, side, side]
    kind = TensorProto.FLOAT
    image = "images"
    if layout == "ssd":
        shape, kind = [batch, side, side, 3], TensorProto.UINT8
        image = graph.node("Cast", image, to=TensorProto.FLOAT)
        image = graph.node("Transpose", image, perm=[0, 3, 1, 2])
    if layout == "torchvision":
        shape = shape[1:]
        image = graph.node("Unsqueeze", image, axes=[0])
    inputs = [helper.make_tensor_value_info("images", kind, shape)]
    if layout == "dfine":
        sizes = helper.make_tensor_value_info("orig_target_sizes", TensorProto.INT64, [batch, 2])
        inputs.append(sizes)
    corners, present = _boxes(graph, _slowed(graph, image, takes_s), layout, size)
    found = FORMS[layout](graph, corners, present, size)
    if operator:
        found = {name: graph.node(operator, each) for name, each in found.items()}
    for name, each in zip(outputs or found, found.values(), strict=True):
        graph.node("Identity", each, name=name)
    values = [
        helper.make_tensor_value_info(
            name, TensorProto.FLOAT, ["a", "b", "c"] if operator else None
        )
        for name in outputs or found
    ]
    if layout in ("dfine", "torchvision"):
        values[0] = helper.make_tensor_value_info(values[0].name, TensorProto.INT64, None)
    model = helper.make_model(
        helper.make_graph(graph.nodes, "tiny", inputs, values, graph.weights),
        opset_imports=[helper.make_opsetid("", 12)],
        ir_version=8,
    )
    helper.set_model_props(model, {"names": str(NAMES)} if metadata is None else dict(metadata))
    if operator in ("", "Identity"):
        model = onnx.shape_inference.infer_shapes(model)  # OpenCV needs them
    path.write_bytes(model.SerializeToString())
    return path


def _slowed(graph: Graph, image: str, takes_s: float) -> str:
    """Add convolutions whose results are multiplied by 0."""
    if not takes_s:
        return image
    return graph.node("Add", image, _convolved(graph, image, ceil(takes_s / _convolution_s())))


def _convolved(graph: Graph, image: str, count: int) -> str:
    slow = graph.node("Conv", image, graph.constant(np.full((64, 3, 3, 3), 0.01)), pads=[1] * 4)
    kernel = graph.constant(np.full((64, 64, 3, 3), 1 / (64 * 9)))  # numbers near 0 are slow
    for _ in range(count):
        slow = graph.node("Conv", slow, kernel, pads=[1] * 4)
    return graph.node("Conv", slow, graph.constant(np.zeros((3, 64, 1, 1))))


@cache
def _convolution_s() -> float:
    """Return the CPU time that one thread takes for a convolution."""
    graph, count = Graph(), 20
    output = _convolved(graph, "images", count)
    values = [
        helper.make_tensor_value_info(name, TensorProto.FLOAT, [1, 3, SIZE, SIZE])
        for name in ("images", output)
    ]
    made = helper.make_graph(graph.nodes, "slow", values[:1], values[1:], graph.weights)
    model = helper.make_model(made, opset_imports=[helper.make_opsetid("", 12)], ir_version=8)
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = 1
    session = onnxruntime.InferenceSession(model.SerializeToString(), options)
    picture = np.full((1, 3, SIZE, SIZE), 0.5, np.float32)

    def run_s() -> float:
        begun_s = time.thread_time()  # without the time that other processes take meanwhile
        session.run(None, {"images": picture})
        return time.thread_time() - begun_s

    return min(run_s() for _ in range(5)) / count


def _boxes(graph: Graph, image: str, layout: str, size: int) -> tuple[str, str]:
    """Return left, top, right, bottom of each colour, (n, 3, 4), and whether it is there."""
    # A pixel is of a colour if that channel is above the sum of the other two by half of the range.
    weights = 2 * np.eye(3) - 1
    bias = np.full(3, -0.5)
    if layout == "nanodet":  # undo the normalisation
        bias = bias + weights @ MEAN
        weights = weights * DEVIATION
    if layout in ("yolox", "ssd"):
        weights = weights / 255
    if layout in ("yolox", "nanodet"):
        weights = weights[:, ::-1]
    marked = graph.node(
        "Conv", image, graph.constant(weights[:, :, None, None]), graph.constant(bias)
    )
    marked = graph.node("Mul", marked, graph.constant(1e3))
    marked = graph.node("Clip", marked, graph.constant(0.0), graph.constant(1.0))
    edges = {}
    for name, axis in (("x", 2), ("y", 3)):
        line = graph.node("ReduceMax", marked, axes=[axis], keepdims=0)
        after = graph.node("Mul", line, graph.constant(np.arange(1, size + 1)))
        edges[name, "high"] = graph.node("ReduceMax", after, axes=[2], keepdims=1)
        before = graph.node("Mul", line, graph.constant(np.arange(size, 0, -1)))
        first = graph.node("ReduceMax", before, axes=[2], keepdims=1)
        edges[name, "low"] = graph.node("Sub", graph.constant(float(size)), first)
        present = graph.node("ReduceMax", line, axes=[2], keepdims=1)
    order = [edges[axis, end] for end in ("low", "high") for axis in ("x", "y")]
    return graph.node("Concat", *order, axis=2), present


def _centred(graph: Graph, corners: str) -> str:
    """Return centre x, centre y, width, height of corners."""
    to_centres = np.array([[0.5, 0, -1, 0], [0, 0.5, 0, -1], [0.5, 0, 1, 0], [0, 0.5, 0, 1]])
    return graph.node("MatMul", corners, graph.constant(to_centres))


def _scores(graph: Graph, present: str) -> str:
    return graph.node("Mul", present, graph.constant(np.diag(SCORES)[None]))


def _sure(graph: Graph, present: str) -> str:
    return graph.node("Mul", present, graph.constant(np.array(SCORES)[None, :, None]))


def _numbers(graph: Graph, present: str, first: int = 0) -> str:
    zeros = graph.node("Mul", present, graph.constant(0.0))
    return graph.node("Add", zeros, graph.constant(np.arange(first, first + 3)[None, :, None]))


def _padded(graph: Graph, rows: str, total: int, before: int = 0, value: float = 0.0) -> str:
    pads = graph.constant([0, before, 0, 0, total - 3 - before, 0], np.int64)
    return graph.node("Pad", rows, pads, graph.constant(value))


def _flat(graph: Graph, values: str) -> str:
    return graph.node("Squeeze", values, axes=[2])


def _yolov5(graph: Graph, corners: str, present: str, _: int) -> dict[str, str]:
    rows = graph.node("Concat", _centred(graph, corners), present, _scores(graph, present), axis=2)
    return {"output0": _padded(graph, rows, 3 * CELLS)}


def _yolov8(graph: Graph, corners: str, present: str, size: int) -> dict[str, str]:
    rows = graph.node("Concat", _centred(graph, corners), _scores(graph, present), axis=2)
    cells = sum((size // stride) ** 2 for stride in (8, 16, 32))
    return {"output0": graph.node("Transpose", _padded(graph, rows, cells), perm=[0, 2, 1])}


def _yolo_nms(graph: Graph, corners: str, present: str, _: int) -> dict[str, str]:
    rows = graph.node("Concat", corners, _sure(graph, present), _numbers(graph, present), axis=2)
    return {"output0": _padded(graph, rows, 300)}


def _yolox(graph: Graph, corners: str, present: str, _: int) -> dict[str, str]:
    centred = _centred(graph, corners)
    eighths = graph.node("Mul", centred, graph.constant(1 / 8))
    split = graph.node("MatMul", eighths, graph.constant(np.eye(4)[:, :2]))
    places = graph.node("Sub", split, graph.constant([[[0, 0], [1, 0], [2, 0]]]))
    sides = graph.node("MatMul", eighths, graph.constant(np.eye(4)[:, 2:]))
    logs = graph.node("Log", graph.node("Max", sides, graph.constant(1e-3)))
    rows = graph.node("Concat", places, logs, present, _scores(graph, present), axis=2)
    return {"output": _padded(graph, rows, CELLS)}


def _nanodet(graph: Graph, corners: str, present: str, _: int) -> dict[str, str]:
    """Its rows are those of three cells of 32 pixels, whose centres the boxes must contain."""
    centres = np.array([[16, 16], [48, 16], [16, 48]], float)
    signs = graph.node("Mul", corners, graph.constant([[[-1, -1, 1, 1]]]))
    offset = np.concatenate([centres, -centres], axis=1)[None]
    reach = graph.node(
        "Mul", graph.node("Add", signs, graph.constant(offset)), graph.constant(1 / 32)
    )
    # The mean over the bins is right if each of the two nearest has its share.
    bins = graph.node("MatMul", reach, graph.constant(np.kron(np.eye(4), np.ones((1, 8)))))
    away = graph.node("Abs", graph.node("Sub", bins, graph.constant(np.tile(np.arange(8), 4))))
    share = graph.node("Max", graph.node("Sub", graph.constant(1.0), away), graph.constant(1e-9))
    rows = graph.node("Concat", _scores(graph, present), graph.node("Log", share), axis=2)
    return {"output": _padded(graph, rows, CELLS, before=80)}


def _rtdetr(graph: Graph, corners: str, present: str, size: int) -> dict[str, str]:
    boxes = graph.node("Mul", _centred(graph, corners), graph.constant(1 / size))
    rows = graph.node("Concat", boxes, _scores(graph, present), axis=2)
    return {"output0": _padded(graph, rows, 300)}


def _detr(graph: Graph, corners: str, present: str, size: int) -> dict[str, str]:
    boxes = graph.node("Mul", _centred(graph, corners), graph.constant(1 / size))
    rise = np.diag([np.log(each / (1 - each)) + 20 for each in SCORES])
    logits = graph.node("Mul", present, graph.constant(rise[None]))
    logits = graph.node("Sub", logits, graph.constant(20.0))
    return {
        "logits": _padded(graph, logits, 300, value=-20.0),
        "pred_boxes": _padded(graph, boxes, 300),
    }


def _dfine(graph: Graph, corners: str, present: str, size: int) -> dict[str, str]:
    sizes = graph.node("Cast", "orig_target_sizes", to=TensorProto.FLOAT)
    sizes = graph.node("Unsqueeze", graph.node("Concat", sizes, sizes, axis=1), axes=[1])
    boxes = graph.node("Mul", corners, graph.constant(1 / size))
    labels = graph.node("Cast", _flat(graph, _numbers(graph, present)), to=TensorProto.INT64)
    scores = _flat(graph, _sure(graph, present))
    return {"labels": labels, "boxes": graph.node("Mul", boxes, sizes), "scores": scores}


def _ssd(graph: Graph, corners: str, present: str, size: int) -> dict[str, str]:
    swap = np.eye(4)[:, [1, 0, 3, 2]] / size
    return {
        "detection_boxes": graph.node("MatMul", corners, graph.constant(swap)),
        "detection_classes": _flat(graph, _numbers(graph, present)),
        "detection_scores": _flat(graph, _sure(graph, present)),
    }


def _torchvision(graph: Graph, corners: str, present: str, _: int) -> dict[str, str]:
    def rows(values: str, *shape: int) -> str:
        return graph.node("Reshape", values, graph.constant(shape, np.int64))

    labels = graph.node("Cast", rows(_numbers(graph, present), 3), to=TensorProto.INT64)
    return {
        "labels": labels,
        "boxes": rows(corners, 3, 4),
        "scores": rows(_sure(graph, present), 3),
    }


FORMS = {
    "yolov5": _yolov5,
    "yolov8": _yolov8,
    "yolo_nms": _yolo_nms,
    "yolox": _yolox,
    "nanodet": _nanodet,
    "rtdetr": _rtdetr,
    "detr": _detr,
    "dfine": _dfine,
    "ssd": _ssd,
    "torchvision": _torchvision,
}
"""What makes the outputs of each layout, by their names."""
