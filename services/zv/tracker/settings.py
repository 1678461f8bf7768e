"""The tracker's options; flags, configuration files and live parameters derive from them."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Annotated, ClassVar, Literal, Self

from pydantic import AfterValidator, BeforeValidator, Field, model_validator

from zenoh_vision.config.constraints import Form
from zenoh_vision.config.consumer_options import (
    DepthMax,
    DepthMin,
    FrameTransport,
    MaxAge,
    check_depth_range,
)
from zenoh_vision.config.durations import SECONDS
from zenoh_vision.config.parameters import Live
from zenoh_vision.config.roles import Role
from zenoh_vision.config.settings import (
    CameraNames,
    FromText,
    LocalPath,
    ServiceSettings,
    cameras_of,
)
from zenoh_vision.keys import DEFAULT_CAMERA
from zv.tracker import shapes
from zv.tracker.detector.options import (
    CLASSES_FORM,
    MAX_THREADS,
    Colours,
    Device,
    Fit,
    LayoutName,
    RuntimeName,
    Values,
    classes_of,
    size_of,
)


def _parsed_by(parse: Callable[[str], object]) -> AfterValidator:
    """Return a validator that keeps a text as it is, if it can be parsed."""

    def kept(text: str) -> str:
        parse(text)
        return text

    return AfterValidator(kept)


Polygons = Annotated[
    str,
    Field(max_length=shapes.MAX_CHARACTERS),
    _parsed_by(shapes.polygons),
    Form(shapes.POLYGONS_FORM),
    Live(),
]
PixelPolygons = Annotated[Polygons, _parsed_by(partial(shapes.polygons, world=False))]
Lines = Annotated[
    str,
    Field(max_length=shapes.MAX_CHARACTERS),
    _parsed_by(shapes.lines),
    Form(shapes.LINES_FORM),
    Live(),
]
Pipeline = Literal["robust", "tutorial", "detector"]
FileName = Annotated[str, Field(min_length=1)] | None


def _joined(value: object) -> object:
    """Return a list of texts as one text: in TOML, classes may be a list."""
    if isinstance(value, list) and all(isinstance(each, str) for each in value):
        return ", ".join(value)
    return value


class TrackerSettings(ServiceSettings):
    """Options of ``zv tracker``; those of ``tutorial`` have the tutorial's values as defaults."""

    env_prefix: ClassVar[str] = "ZV_TRACKER_"

    camera: CameraNames = Field(
        DEFAULT_CAMERA,
        description="camera this node belongs to; several as front,left, or * for all",
    )

    pipeline: Annotated[Pipeline, Live(), Role("pipeline")] = Field(
        "robust",
        description="robust: all moving objects, with ids; tutorial: MOG2, closing, median, "
        "threshold, largest contour, without ids; detector: the objects that a model finds, "
        "with ids and classes",
    )
    model: Annotated[FileName, LocalPath()] = Field(
        None, description="detector: the ONNX file of a detector"
    )
    class_names: Annotated[FileName, LocalPath()] = Field(
        None,
        description="detector: file with the names of the model's classes, one a line, that of "
        "class 0 first; not set: those in the model",
    )
    classes: Annotated[
        str,
        BeforeValidator(_joined),
        Field(max_length=8000),
        _parsed_by(classes_of),
        Form(CLASSES_FORM),
        Live(),
    ] = Field(
        "",
        description="detector: classes to keep, each with a least score of its own if wanted; "
        "empty: all",
    )
    least_score: Annotated[float, Live()] = Field(
        0.5,
        ge=0.01,
        le=1,
        description="detector: score from which on a box begins a track; down to 0.1 it may "
        "continue one",
    )
    suppression: Annotated[float, Live()] = Field(
        0.6,
        ge=0.05,
        le=1,
        description="detector: share of their union from which on two boxes of a class are one "
        "object",
    )
    every: Annotated[int, Live("frames")] = Field(
        1,
        ge=0,
        le=10_000,
        description="detector: the model sees every so manieth frame, which is published when "
        "it has; background subtraction follows the objects between. 0: it sees a frame "
        "whenever it is free, and each frame is published at once",
    )
    on_motion: Annotated[bool, Live()] = Field(
        False, description="detector: the model sees frames only while something moves"
    )
    layout: Literal["auto", LayoutName] = Field(
        "auto",
        description="detector: what the model's outputs mean; auto: recognised by names and shapes",
    )
    input_size: Annotated[
        Annotated[str, _parsed_by(size_of)] | None, Form("width and height such as 640x480")
    ] = Field(None, description="detector: size of the model's input, if the file does not fix it")
    fit: Literal["auto", Fit] = Field(
        "auto",
        description="detector: how a frame is placed in the input. centre: with equal margins; "
        "corner: with margins at the right and below; stretch: without; auto: by the layout",
    )
    colours: Literal["auto", Colours] = Field(
        "auto", description="detector: order of the input's channels; auto: by the layout"
    )
    values: Literal["auto", Values] = Field(
        "auto",
        description="detector: range of the input's numbers. signed: -1 to 1; imagenet: less "
        "its mean, by its deviation; auto: by the layout",
    )
    runtime: RuntimeName = Field(
        "auto",
        description="detector: what runs the model; auto: onnxruntime if it is installed, else "
        "opencv",
    )
    device: Device = Field(
        "auto",
        description="detector: where it runs; auto: the first of cuda, openvino, coreml, cpu",
    )
    model_threads: int = Field(
        0,
        ge=0,
        le=256,
        description="detector: threads of the model on the CPU; 0: one per processor, at most "
        f"{MAX_THREADS}",
    )
    learning_time: Annotated[float, Live("s"), SECONDS] = Field(
        10.0,
        ge=0.5,
        le=3600,
        description="robust: time after which a change of the scene has become background by 63 %",
    )
    freeze: Annotated[bool, Live()] = Field(
        False, description="robust: keep the background as it is, learn nothing"
    )
    reset: Annotated[int, Live()] = Field(
        0, ge=0, le=2**31 - 1, description="robust: each change learns the background anew"
    )
    min_area: Annotated[float, Live("square pixels")] = Field(
        0.0,
        ge=0,
        le=1e8,
        description="robust: smallest foreground of an object; 0: 0.08 % of the picture",
    )
    max_area: Annotated[float, Live("square pixels")] = Field(
        0.0,
        ge=0,
        le=1e8,
        description="robust: largest connected foreground that may be objects; 0: no limit",
    )
    convex: Annotated[bool, Live()] = Field(
        False,
        description="robust: all objects are convex, as most parts on a belt are; those that "
        "touch are told apart by the concavities between them",
    )
    regions: PixelPolygons = Field(
        "",
        description="robust: polygons in pixels; objects are detected only inside them; "
        "empty: everywhere",
    )
    ignore: PixelPolygons = Field(
        "", description="robust: polygons in pixels; objects inside them are ignored"
    )
    keep_lost: Annotated[float, Live("s"), SECONDS] = Field(
        2.0, ge=0, le=60, description="robust: how long a track that is not seen is kept"
    )
    history: Annotated[int, Live("frames")] = Field(
        700,
        ge=1,
        le=100_000,
        description="tutorial: number of frames that form the background model",
    )
    var_threshold: Annotated[float, Live()] = Field(
        25.0,
        ge=0.01,
        le=10_000,
        description="squared Mahalanobis distance above which a pixel is foreground",
    )
    detect_shadows: Annotated[bool, Live()] = Field(True, description="leave out shadows")
    closing: Annotated[int, Live("pixels")] = Field(
        20, ge=0, le=255, description="tutorial: side of the closing kernel, pixels; 0: no closing"
    )
    median: Annotated[Literal[0, 3, 5, 7, 9, 11, 13, 15], FromText, Live("pixels")] = Field(
        5, description="tutorial: side of the median filter, pixels; 0: none"
    )
    threshold: Annotated[int, Live()] = Field(
        127, ge=0, le=254, description="tutorial: mask values above it are foreground"
    )
    zones: Polygons = Field(
        "",
        description="zones; entering and leaving one is an event; in pixels, or in units of "
        "the calibration after the word world",
    )
    lines: Lines = Field(
        "",
        description="lines; crossing one is an event; in pixels, or in units of the "
        "calibration after the word world",
    )
    dwell: Annotated[float, Live("s"), SECONDS] = Field(
        10.0, ge=0.01, le=86_400, description="time in a zone after which it is an event"
    )
    anchor: Annotated[Literal["centre", "foot"], Live()] = Field(
        "centre",
        description="point of an object that enters zones and crosses lines. foot: the middle "
        "of the lower edge of its box",
    )
    quality: Annotated[int, Live()] = Field(80, ge=1, le=100, description="JPEG quality of tracked")
    transport: FrameTransport = "auto"
    depth_min: DepthMin = None
    depth_max: DepthMax = None
    max_age: MaxAge = 0.4
    max_pixels: int = Field(
        1920 * 1200,
        ge=1,
        le=7680 * 4320,
        description="width times height; larger frames are dropped. One frame needs up to 130 "
        "bytes of memory per pixel",
    )

    @property
    def cameras(self) -> tuple[str, ...]:
        """The names of the cameras, each once; empty for all cameras."""
        return cameras_of(self.camera)

    @model_validator(mode="after")
    def _has_model(self) -> Self:
        if self.pipeline == "detector" and self.model is None:
            raise ValueError(
                "pipeline = detector needs model, an ONNX file, from the start of the tracker"
            )
        return self

    _depth_in_order = model_validator(mode="after")(check_depth_range)
