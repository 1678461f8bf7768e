"""What a model is given: values, order, size and number of pictures; by a runtime that pretends."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from zenoh_vision.errors import ConfigurationError
from zv.tracker.detector import model as models
from zv.tracker.detector.errors import ModelFailed, UnknownLayout, UnusableModel
from zv.tracker.detector.model import MAX_BATCH, Model, ModelOptions
from zv.tracker.detector.onnx_file import OnnxFile, Side, Tensor

SIDE = 64
Outputs = Callable[[int], Mapping[str, NDArray[Any]]]
"""Returns the outputs for a number of pictures."""


class Pretends:
    """A runtime that says what it is told to; it notes for how many pictures."""

    name, device = "test", "cpu"

    def __init__(self, outputs: Outputs) -> None:
        self._outputs = outputs
        self.first = dict(outputs(1))
        self.pictures: list[int] = []

    def run(self, inputs: Mapping[str, NDArray[Any]]) -> dict[str, NDArray[Any]]:
        [image] = inputs.values()
        self.pictures.append(len(image))
        return dict(self._outputs(len(image)))


Make = Callable[..., Model]


@pytest.fixture
def make(monkeypatch: pytest.MonkeyPatch) -> Make:
    """``make(outputs, shape=..., dtype=..., metadata=..., layout=...)``: a model without a file."""

    def made(
        outputs: Outputs | None = None,
        shape: tuple[Side, ...] = (1, 3, SIDE, SIDE),
        dtype: str = "float32",
        metadata: Mapping[str, str] | None = None,
        more: tuple[Tensor, ...] = (),
        **options: Any,
    ) -> Model:
        says = outputs or (lambda count: {"output0": np.zeros((count, 7, 84), np.float32)})
        inputs = (Tensor("images", dtype, shape), *more)
        file = OnnxFile(Path("m.onnx"), inputs, (), dict(metadata or {}), frozenset())
        monkeypatch.setattr(models, "read_onnx", lambda _: file)
        monkeypatch.setattr(models, "opened", lambda *_: Pretends(says))
        return Model(ModelOptions("m.onnx", **{"layout": "yolov8", **options}))

    return made


# Values


RED, GREEN, BLUE = 30, 20, 10
MEAN = {"r": (0.485, 0.229), "b": (0.406, 0.225)}


def imagenet(level: int, channel: str) -> float:
    mean, deviation = MEAN[channel]
    return (level / 255 - mean) / deviation


@pytest.mark.parametrize(
    ("colours", "values", "first", "last"),
    [
        ("rgb", "0-1", RED / 255, BLUE / 255),
        ("bgr", "0-1", BLUE / 255, RED / 255),
        ("rgb", "0-255", RED, BLUE),
        ("bgr", "0-255", BLUE, RED),
        ("rgb", "signed", RED / 127.5 - 1, BLUE / 127.5 - 1),
        ("rgb", "imagenet", imagenet(RED, "r"), imagenet(BLUE, "b")),
        ("bgr", "imagenet", imagenet(BLUE, "b"), imagenet(RED, "r")),
    ],
)
@pytest.mark.parametrize("rows_first", [True, False])
def test_the_input_has_the_order_and_range_that_are_named(
    colours: str, values: str, first: float, last: float, rows_first: bool, make: Make
):
    shape = (1, 3, SIDE, SIDE) if rows_first else (1, SIDE, SIDE, 3)
    model = make(shape=shape, colours=colours, values=values)
    canvas = np.full((SIDE, SIDE, 3), (BLUE, GREEN, RED), np.uint8)
    [image] = model.inputs([canvas]).values()
    assert (image.shape, image.dtype) == (shape, np.float32)
    pixel = image[0, :, 5, 5] if rows_first else image[0, 5, 5]
    assert pixel[[0, 2]].tolist() == pytest.approx([first, last], abs=1e-5)


@pytest.mark.parametrize("colours", ["rgb", "bgr"])
@pytest.mark.parametrize("rows_first", [True, False])
def test_an_input_of_uint8_gets_the_pixels_as_they_are(colours: str, rows_first: bool, make: Make):
    shape = (1, 3, SIDE, SIDE) if rows_first else (1, SIDE, SIDE, 3)
    ssd = {"boxes": (1, 2, 4), "scores": (1, 2), "labels": (1, 2)}
    outputs = {name: np.zeros(sides, np.float32) for name, sides in ssd.items()}
    model = make(lambda _: outputs, shape, "uint8", layout="ssd", colours=colours)
    [image] = model.inputs([np.full((SIDE, SIDE, 3), (BLUE, GREEN, RED), np.uint8)]).values()
    assert (image.shape, image.dtype) == (shape, np.uint8)
    pixel = image[0, :, 5, 5] if rows_first else image[0, 5, 5]
    assert pixel.tolist() == ([RED, GREEN, BLUE] if colours == "rgb" else [BLUE, GREEN, RED])


def test_the_fit_is_that_of_the_layout_unless_it_is_named(make: Make):
    yolox = lambda _: {"output": np.zeros((1, 84, 8), np.float32)}  # noqa: E731
    corner = make(yolox, layout="yolox").placement((128, 64))
    assert (corner.size, corner.top) == ((64, 32), 0)
    centre = make(yolox, layout="yolox", fit="centre").placement((128, 64))
    assert (centre.size, centre.top) == ((64, 32), 16)
    stretch = make(lambda _: {"o": np.zeros((1, 300, 7), np.float32)}, layout="rtdetr")
    assert stretch.placement((128, 64)).size == (64, 64)


# Inputs that cannot be served


@pytest.mark.parametrize(
    ("shape", "dtype", "more", "error", "words"),
    [
        ((1, 3, 64, 64), "float32", Tensor("b", "float32", (1, 3, 64, 64)), UnknownLayout, "one"),
        ((1, 3, 64, 64), "float32", Tensor("im_shape", "float32", (1, 2)), UnknownLayout, "most"),
        ((1, 10), "float32", None, UnknownLayout, "one input for a picture"),
        ((1, 1, 64, 64), "float32", None, UnknownLayout, "no input for a picture of 3 channels"),
        ((1, 3, 64, 64), "int64", None, UnknownLayout, "allowed: float32, float16, uint8"),
        ((10, 3, 64, 64), "float32", None, UnusableModel, "takes 10 pictures at once"),
        ((1, 3, None, 64), "float32", None, UnknownLayout, "--input-size, such as"),
        ((1, 3, 64, None), "float32", None, UnknownLayout, "--input-size, such as"),
        ((1, 3, 64, 5000), "float32", None, UnknownLayout, "an input of 5000x64; at most 4096"),
    ],
)
def test_an_input_that_cannot_be_served_is_refused(
    shape: tuple[Side, ...],
    dtype: str,
    more: Tensor | None,
    error: type[Exception],
    words: str,
    make: Make,
):
    with pytest.raises(error, match=words):
        make(shape=shape, dtype=dtype, more=(more,) if more else ())


def test_a_size_of_which_one_side_is_fixed_may_be_given(make: Make):
    assert make(shape=(1, 3, None, 64), input_size=(64, 32)).size == (64, 32)
    with pytest.raises(ConfigurationError, match="fixed"):
        make(input_size=(64, 32))


# Outputs


def test_columns_of_masks_and_points_are_not_classes(make: Make):
    columns = np.zeros((1, 4 + 2 + 32, 84), np.float32)
    columns[0, :, 0] = (20, 20, 10, 10, 0.2, 0.8, *[9.0] * 32)
    names = {"names": "{0: 'a', 1: 'b'}", "task": "segment"}
    model = make(lambda _: {"output0": columns}, metadata=names)
    [found] = detected(model)
    assert (found.name, found.score) == ("b", 0.8)


def test_only_layouts_without_suppression_of_their_own_get_ours(make: Make):
    columns = np.zeros((1, 5, 84), np.float32)
    columns[0, :, :2] = np.array([[20, 20, 10, 10, 0.9], [20, 20, 10, 10, 1.01]]).T
    found = detected(make(lambda _: {"output0": columns}))
    assert [each.score for each in found] == [1.0]  # of the surer one; a score is at most 1
    rows = np.array([[[15, 15, 25, 25, 0.9, 0], [15, 15, 25, 25, 0.8, 0]]], np.float32)
    assert len(detected(make(lambda _: {"output0": rows}, layout="yolo_nms"))) == 2


def detected(model: Model, count: int = 1) -> list[models.Detection]:
    """Return what a model finds in the last of some pictures."""
    blank = np.zeros((SIDE, SIDE, 3), np.uint8)
    prepared = [model.prepared((SIDE, SIDE), lambda *_: blank)] * count
    return model.detect(prepared, 0.1, 0.5)[-1].detections


# Several pictures at once


BATCH: tuple[Side, ...] = (None, 3, SIDE, SIDE)


def test_a_model_whose_outputs_are_by_picture_sees_several_at_once(make: Make):
    def ssd(count: int) -> dict[str, NDArray[Any]]:
        scores = np.zeros((count, 2), np.float32)
        scores[-1, 0] = 0.5 + 0.1 * count
        boxes = np.tile(np.array([0.0, 0.0, 0.5, 0.5], np.float32), (count, 2))
        return {"boxes": boxes, "scores": scores, "labels": scores * 0}

    model = make(ssd, BATCH, layout="ssd", values="0-1")
    assert model.most == MAX_BATCH
    assert [each.score for each in detected(model, 3)] == [0.8]


@pytest.mark.parametrize(
    ("layout", "outputs"),
    [
        ("yolov8", lambda _: {"output0": np.zeros((1, 7, 84))}),
        ("yolov8", lambda n: {"output0": np.zeros((n, 7, 84)), "count": np.float32(n)}),
        ("yolo_nms", lambda _: {"output": np.zeros((2, 7))}),
        (
            "torchvision",
            lambda _: {"boxes": np.zeros((2, 4)), "scores": np.zeros(2), "labels": np.zeros(2)},
        ),
    ],
    ids=["one whatever it is given", "a number for all", "rows of all", "two objects by chance"],
)
def test_a_model_whose_outputs_are_not_by_picture_sees_one(
    layout: str, outputs: Outputs, make: Make
):
    model = make(outputs, BATCH, layout=layout)
    assert model.most == 1
    assert model.runtime.pictures == [2]  # it was tried


def test_a_model_that_fails_with_two_pictures_sees_one(make: Make):
    def one(count: int) -> dict[str, NDArray[Any]]:
        if count > 1:
            raise ModelFailed("a Reshape to one picture")
        return {"output0": np.zeros((1, 7, 84), np.float32)}

    assert make(one, BATCH).most == 1


@pytest.mark.parametrize("shape", [(1, 3, SIDE, SIDE), (3, SIDE, SIDE)])
def test_a_model_for_one_picture_is_not_tried_with_two(shape: tuple[Side, ...], make: Make):
    model = make(shape=shape)
    assert model.most == 1
    assert model.runtime.pictures == []
