"""A detector model of a file: from pictures to boxes with names and scores."""

from __future__ import annotations

import ast
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final, Literal, get_args

import cv2
import numpy as np
from numpy.typing import NDArray

from zenoh_vision.errors import ConfigurationError
from zv.tracker.detector.class_names import Names, name_of, names_in, read_names
from zv.tracker.detector.decoding import Facts
from zv.tracker.detector.errors import ModelFailed, UnknownLayout, UnusableModel
from zv.tracker.detector.layouts import LAYOUTS, recognised
from zv.tracker.detector.onnx_file import OnnxFile, Tensor, read_onnx
from zv.tracker.detector.options import Colours, Device, Fit, LayoutName, RuntimeName, Values
from zv.tracker.detector.placement import Pixels, Placement, placement
from zv.tracker.detector.runtimes import opened
from zv.tracker.detector.suppression import (
    MOST_BOXES,
    MOST_CANDIDATES,
    bounded,
    finite,
    suppressed,
)

MAX_SIDE: Final = 4096
MAX_BATCH: Final = 8

RANGES: Final[dict[Values, tuple[tuple[float, ...], tuple[float, ...]]]] = {
    "0-1": ((0.0,) * 3, (1.0,) * 3),
    "0-255": ((0.0,) * 3, (1 / 255,) * 3),
    "signed": ((0.5,) * 3, (0.5,) * 3),
    "imagenet": ((0.485, 0.456, 0.406), (0.229, 0.224, 0.225)),
}
"""What is subtracted from R, G and B of 0 to 1, and by what the rest is divided then."""


@dataclass(frozen=True, slots=True)
class ModelOptions:
    """What is known about a model beside its file; ``auto`` and None: found out by the file."""

    file: str  # the ONNX file
    layout: LayoutName | Literal["auto"] = "auto"  # what its outputs mean
    class_names: str | None = None  # a file with the names of its classes, one a line
    input_size: tuple[int, int] | None = None  # width and height of its input
    fit: Fit | Literal["auto"] = "auto"  # how a picture is placed in its input
    colours: Colours | Literal["auto"] = "auto"  # order of its channels
    values: Values | Literal["auto"] = "auto"  # range of its numbers
    runtime: RuntimeName = "auto"  # what runs it
    device: Device = "auto"  # on what
    threads: int = 0  # on the CPU; 0: one per processor, at most 4


@dataclass(frozen=True, slots=True)
class Detection:
    """An object that the model found."""

    box: tuple[float, float, float, float]  # left, top, right, bottom in pixels of the picture
    score: float  # how sure the model is, 0 to 1
    number: int  # number of its class
    name: str  # name of its class


@dataclass(frozen=True, slots=True)
class Prepared:
    """A picture in the form of the model's input."""

    canvas: Pixels  # (height, width, 3) uint8, BGR
    place: Placement  # where the picture is in it


@dataclass(slots=True)
class Found:
    """What a run found in one picture."""

    detections: list[Detection] = field(default_factory=list)  # the surest first
    not_finite: int = 0  # boxes that were left out since a number was none
    left_out: int = 0  # boxes that were left out since there were too many


class Model:
    """A model that was loaded and has run once; used by one thread at a time.

    Attributes:
        layout: What its outputs mean.
        size: Width and height of its input.
        runtime: What runs it.
        names: Names of its classes, as far as known.
        most: Largest number of pictures in one run.

    Raises:
        UnusableModel: The file is no model that runs here; says what to do.
        UnknownLayout: What its inputs or outputs mean is not known; names them.
        ConfigurationError: An option does not fit.
    """

    def __init__(self, options: ModelOptions) -> None:
        self.file = file = read_onnx(Path(options.file))
        self._image = _image_of(file)
        self._rows_first = self._image.shape[-1] != 3  # channels, rows, columns
        self.size = _size_of(file, self._image, options.input_size, self._rows_first)
        self.names: Names = names_in(file.metadata)
        if options.class_names is not None:
            self.names = read_names(options.class_names)
        self._colours: Colours = "rgb"
        self._values: Values = "0-1"
        blank = np.zeros((self.size[1], self.size[0], 3), np.uint8)
        example = self.inputs([blank])
        self.runtime = opened(file, example, options.runtime, options.device, options.threads)
        shapes = {name: each.shape for name, each in self.runtime.first.items()}
        classes = len(self.names)
        self.layout: LayoutName = (
            recognised(file, shapes, self.size, classes)
            if options.layout == "auto"
            else options.layout
        )
        layout = LAYOUTS[self.layout]
        self._fit: Fit = layout.fit if options.fit == "auto" else options.fit
        self._colours = layout.colours if options.colours == "auto" else options.colours
        self._values = self._values_of(options, layout.values)
        self._facts = Facts(self.size, self._classes(classes))
        self.most = MAX_BATCH if self._takes_two(blank) else 1
        self._check(options)

    @property
    def words(self) -> str:
        """The file and what runs it, for people."""
        return f"{self.file.path.name} by {self.runtime.name} on {self.runtime.device}"

    def placement(self, size: tuple[int, int]) -> Placement:
        """Return where a picture of a width and height is in the model's input."""
        return placement(size, self.size, self._fit)

    def prepared(self, size: tuple[int, int], reduced: Callable[[int, int], Pixels]) -> Prepared:
        """Return a picture in the form of the model's input.

        Args:
            size: Its width and height.
            reduced: Returns its pixels, (height, width, 3) uint8 BGR, at least as large as a width
                and height.
        """
        place = self.placement(size)
        return Prepared(place.drawn(reduced(*place.size)), place)

    def detect(self, pictures: Sequence[Prepared], least: float, overlap: float) -> list[Found]:
        """Find the objects of pictures, at most ``most``.

        Args:
            pictures: The pictures.
            least: Smallest score.
            overlap: Intersection over union from which on two boxes of a class show one object.

        Raises:
            ModelFailed: The run failed.
        """
        outputs = self.runtime.run(self.inputs([each.canvas for each in pictures]))
        return [
            self._found(self._of_picture(outputs, number), picture.place, least, overlap)
            for number, picture in enumerate(pictures)
        ]

    @np.errstate(all="ignore")  # boxes that become infinite or NaN are counted
    def _found(
        self, outputs: dict[str, NDArray[Any]], place: Placement, least: float, overlap: float
    ) -> Found:
        layout = LAYOUTS[self.layout]
        found, not_finite = finite(layout.decode(outputs, self._facts, least))
        found, left_out = bounded(found, MOST_CANDIDATES if layout.suppress else MOST_BOXES)
        if layout.suppress:
            found = suppressed(found, overlap)
        found, more = bounded(found, MOST_BOXES)
        boxes = place.in_picture(found.boxes)
        seen = np.flatnonzero((boxes[:, 2:] - boxes[:, :2] >= 1).all(axis=1))
        rows = zip(
            boxes[seen].tolist(),
            found.scores[seen].tolist(),
            found.classes[seen].tolist(),
            strict=True,
        )
        detections = [
            Detection(tuple(box), round(min(1.0, score), 4), number, name_of(self.names, number))
            for box, score, number in rows
        ]
        return Found(detections, not_finite, left_out + more)

    def _of_picture(self, outputs: dict[str, NDArray[Any]], number: int) -> dict[str, NDArray[Any]]:
        """Return the outputs for one picture of a batch, without its dimension, as float32."""
        # Rows without that dimension are of models that return as many as there are objects.
        batched = self.most > 1 or any(each.ndim > 2 for each in outputs.values())
        return {
            name: np.asarray(each[number] if batched and each.ndim else each, np.float32)
            for name, each in outputs.items()
        }

    def inputs(self, canvases: Sequence[Pixels]) -> dict[str, NDArray[Any]]:
        """Return the inputs of a run by their names; pictures are (height, width, 3) uint8."""
        blob = self._blob(canvases)
        found = {self._image.name: blob if len(self._image.shape) == 4 else blob[0]}
        for each in self.file.inputs:
            if each is not self._image:  # the size of the picture, in which boxes are wanted
                found[each.name] = np.array([self.size] * len(canvases), each.dtype)
        return found

    def _blob(self, canvases: Sequence[Pixels]) -> NDArray[Any]:
        """Return the numbers of the input for pictures, (n, 3, rows, columns) or (n, ..., 3)."""
        swap = self._colours == "rgb"
        if self._image.dtype == "uint8":
            pixels = np.stack([each[..., ::-1] if swap else each for each in canvases])
            return np.ascontiguousarray(
                pixels.transpose(0, 3, 1, 2) if self._rows_first else pixels
            )
        tables = _tables(self._values)[:: 1 if swap else -1]
        width, height = self.size
        blob: NDArray[Any] = np.empty((len(canvases), 3, height, width), np.float32)
        for planes, canvas in zip(blob, canvases, strict=True):
            channels = cv2.split(canvas)[:: -1 if swap else 1]
            for plane, channel, table in zip(planes, channels, tables, strict=True):
                cv2.LUT(channel, table, dst=plane)  # a fifth of the time of blobFromImage
        if not self._rows_first:
            blob = np.ascontiguousarray(blob.transpose(0, 2, 3, 1))
        return blob.astype(self._image.dtype, copy=False)

    def _values_of(self, options: ModelOptions, usual: Values | None) -> Values:
        if options.values != "auto":
            return options.values
        if usual is not None or self._image.dtype == "uint8":
            return usual or "0-255"
        raise UnknownLayout(
            f"{self.file.path}: models of the layout {self.layout} differ in the range of their "
            f"input's numbers; name it with --values: {', '.join(get_args(Values))}"
        )

    def _classes(self, named: int) -> int:
        """Return the number of classes, if the outputs have more columns than those of classes."""
        has_more = self.file.metadata.get("task") in ("segment", "pose") or self.layout == "nanodet"
        return named if has_more else 0

    def _takes_two(self, blank: Pixels) -> bool:
        """Return whether the model runs on several pictures at once, with outputs for each."""
        if len(self._image.shape) == 3 or self._image.shape[0] is not None:
            return False
        try:
            outputs = self.runtime.run(self.inputs([blank, blank]))
        except ModelFailed:
            return False
        # Rows of all pictures together, as those with the picture's number, may be two by chance.
        return all(
            each.ndim > 0
            and each.shape[0] == 2
            and not (each.ndim == 2 and each.shape[1] in (4, 7))
            for each in outputs.values()
        )

    @np.errstate(all="ignore")
    def _check(self, options: ModelOptions) -> None:
        """Check that the layout and the names of a file fit the outputs.

        Raises:
            UnknownLayout: The layout does not; names the outputs.
            ConfigurationError: There are more names than classes.
        """
        outputs = self.runtime.first
        try:
            of_one = self._of_picture(outputs, 0)
            self._found(of_one, self.placement(self.size), 0.0, 0.5)
            known = LAYOUTS[self.layout].decode(of_one, self._facts, 0.0).known
        except (KeyError, ValueError, IndexError) as error:
            shapes = "; ".join(f"{name} {list(each.shape)}" for name, each in outputs.items())
            raise UnknownLayout(
                f"{options.file}: the outputs do not fit --layout {self.layout} "
                f"({LAYOUTS[self.layout].words}): {shapes} ({error})"
            ) from None
        lines = max(self.names, default=-1) + 1
        if options.class_names is not None and known and lines > known:
            raise ConfigurationError(
                f"--class-names {options.class_names}: {lines} lines for the {known} classes that "
                f"{options.file} has: these are the names of another model"
            )


def _tables(values: Values) -> list[NDArray[np.float32]]:
    """Return the input's number for each of the 256 values of R, G and B."""
    levels = np.arange(256) / 255
    pairs = zip(*RANGES[values], strict=True)
    return [((levels - mean) / scale).astype(np.float32) for mean, scale in pairs]


def _image_of(file: OnnxFile) -> Tensor:
    """Return the input for the picture.

    Raises:
        UnknownLayout: There is none, or there are further inputs whose meaning is not known.
    """
    images = [each for each in file.inputs if len(each.shape) in (3, 4)]
    others = [each for each in file.inputs if each not in images]
    if len(images) != 1 or any("target_sizes" not in each.name for each in others):
        raise UnknownLayout(
            f"{file.path}: it needs one input for a picture, [n, 3, height, width] or [n, height, "
            f"width, 3], n may be missing, and beside it at most orig_target_sizes. {file}"
        )
    [image] = images
    if 3 not in (image.shape[-3], image.shape[-1]):
        raise UnknownLayout(f"{file.path}: {image} is no input for a picture of 3 channels")
    if image.dtype not in ("float32", "float16", "uint8"):
        raise UnknownLayout(f"{file.path}: {image}; allowed: float32, float16, uint8")
    if len(image.shape) == 4 and image.shape[0] not in (None, 1):
        raise UnusableModel(
            f"{file.path}: {image} takes {image.shape[0]} pictures at once; export it for 1, or "
            "with a dimension that is not fixed"
        )
    return image


def _size_of(
    file: OnnxFile, image: Tensor, wanted: tuple[int, int] | None, rows_first: bool
) -> tuple[int, int]:
    """Return width and height of the input.

    Raises:
        ConfigurationError: The setting contradicts the file.
        UnknownLayout: The file does not fix it, and neither does the setting.
    """
    height, width = image.shape[-2:] if rows_first else image.shape[-3:-1]
    if width is not None and height is not None:
        if wanted not in (None, (width, height)):
            raise ConfigurationError(
                f"--input-size: {file.path} has an input of {width}x{height}, which is fixed"
            )
        found = width, height
    elif wanted is not None:
        found = wanted
    else:
        found = _exported_size(file)
    if max(found) > MAX_SIDE:
        raise UnknownLayout(f"{file.path}: an input of {found[0]}x{found[1]}; at most {MAX_SIDE}")
    return found


def _exported_size(file: OnnxFile) -> tuple[int, int]:
    """Return the size in the metadata that Ultralytics writes: ``imgsz``, height and width."""
    try:
        height, width = map(int, ast.literal_eval(file.metadata.get("imgsz", "")))
        if min(height, width) > 0:
            return width, height
    except (ValueError, SyntaxError, TypeError, OverflowError, MemoryError, RecursionError):
        pass
    raise UnknownLayout(
        f"{file.path}: the size of its input is not fixed ({file.inputs[0]}); give that of its "
        "training with --input-size, such as 640x640"
    )
