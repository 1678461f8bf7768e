"""The tracker's options; flags, configuration files and live parameters derive from them."""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal, Self

from pydantic import AfterValidator, Field, model_validator

from zenoh_vision.config.constraints import Form
from zenoh_vision.config.consumer_options import FrameTransport, MaxAge
from zenoh_vision.config.depth_range import DepthMax, DepthMin, check_depth_range
from zenoh_vision.config.durations import SECONDS
from zenoh_vision.config.parameters import Live
from zenoh_vision.config.settings import CameraNames, FromText, ServiceSettings, cameras_of
from zenoh_vision.keys import DEFAULT_CAMERA
from zv.tracker import shapes


def _polygons(text: str) -> str:
    shapes.polygons(text)
    return text


def _pixel_polygons(text: str) -> str:
    shapes.polygons(text, world=False)
    return text


def _lines(text: str) -> str:
    shapes.lines(text)
    return text


class TrackerSettings(ServiceSettings):
    """Options of ``zv tracker``; those of ``tutorial`` have the tutorial's values as defaults."""

    env_prefix: ClassVar[str] = "ZV_TRACKER_"

    camera: Annotated[
        CameraNames,
        Field(description="camera this node belongs to; several as front,left, or * for all"),
    ] = DEFAULT_CAMERA

    pipeline: Annotated[
        Literal["robust", "tutorial"],
        Field(
            description="robust: all moving objects, with ids; tutorial: MOG2, closing, median, "
            "threshold, largest contour, without ids"
        ),
        Live(),
    ] = "robust"
    subtractor: Annotated[
        Literal["mog2", "knn"],
        Field(
            description="robust: background model. mog2: mixture of Gaussians; knn: nearest "
            "neighbours"
        ),
        Live(effect="a change learns the background anew"),
    ] = "mog2"
    learning_time: Annotated[
        float,
        Field(
            ge=0.5,
            le=3600,
            description="robust: time after which a change of the scene has become background "
            "by 63 %",
        ),
        Live("s"),
        SECONDS,
    ] = 10.0
    freeze: Annotated[
        bool, Field(description="robust: keep the background as it is, learn nothing"), Live()
    ] = False
    reset: Annotated[
        int,
        Field(ge=0, le=2**31 - 1, description="robust: each change learns the background anew"),
        Live(),
    ] = 0
    min_area: Annotated[
        float,
        Field(ge=1, le=1e8, description="robust: smallest foreground of an object"),
        Live("square pixels"),
    ] = 160.0
    max_area: Annotated[
        float,
        Field(
            ge=0,
            le=1e8,
            description="robust: largest connected foreground that may be objects; 0: no limit",
        ),
        Live("square pixels"),
    ] = 0.0
    convex: Annotated[
        bool,
        Field(
            description="robust: all objects are convex, as most parts on a belt are; those that "
            "touch are told apart by the concavities between them"
        ),
        Live(),
    ] = False
    regions: Annotated[
        str,
        Field(
            max_length=shapes.MAX_CHARACTERS,
            description="robust: polygons in pixels; objects are detected only inside them; "
            "empty: everywhere",
        ),
        AfterValidator(_pixel_polygons),
        Form(shapes.POLYGONS_FORM),
        Live(),
    ] = ""
    ignore: Annotated[
        str,
        Field(
            max_length=shapes.MAX_CHARACTERS,
            description="robust: polygons in pixels; objects inside them are ignored",
        ),
        AfterValidator(_pixel_polygons),
        Form(shapes.POLYGONS_FORM),
        Live(),
    ] = ""
    keep_lost: Annotated[
        float,
        Field(ge=0, le=60, description="robust: how long a track that is not seen is kept"),
        Live("s"),
        SECONDS,
    ] = 2.0
    history: Annotated[
        int,
        Field(
            ge=1,
            le=100_000,
            description="tutorial: number of frames that form the background model",
        ),
        Live("frames"),
    ] = 700
    var_threshold: Annotated[
        float,
        Field(
            ge=0.01,
            le=10_000,
            description="squared Mahalanobis distance above which a pixel is foreground",
        ),
        Live(),
    ] = 25.0
    detect_shadows: Annotated[bool, Field(description="leave out shadows"), Live()] = True
    closing: Annotated[
        int,
        Field(
            ge=0, le=255, description="tutorial: side of the closing kernel, pixels; 0: no closing"
        ),
        Live("pixels"),
    ] = 20
    median: Annotated[
        Literal[0, 3, 5, 7, 9, 11, 13, 15],
        FromText,
        Field(description="tutorial: side of the median filter, pixels; 0: none"),
        Live("pixels"),
    ] = 5
    threshold: Annotated[
        int,
        Field(ge=0, le=254, description="tutorial: mask values above it are foreground"),
        Live(),
    ] = 127
    zones: Annotated[
        str,
        Field(
            max_length=shapes.MAX_CHARACTERS,
            description="zones; entering and leaving one is an event; in pixels, or in units of "
            "the calibration after the word world",
        ),
        AfterValidator(_polygons),
        Form(shapes.POLYGONS_FORM),
        Live(),
    ] = ""
    lines: Annotated[
        str,
        Field(
            max_length=shapes.MAX_CHARACTERS,
            description="lines; crossing one is an event; in pixels, or in units of the "
            "calibration after the word world",
        ),
        AfterValidator(_lines),
        Form(shapes.LINES_FORM),
        Live(),
    ] = ""
    dwell: Annotated[
        float,
        Field(ge=0.01, le=86_400, description="time in a zone after which it is an event"),
        Live("s"),
        SECONDS,
    ] = 10.0
    anchor: Annotated[
        Literal["centre", "foot"],
        Field(
            description="point of an object that enters zones and crosses lines. foot: the middle "
            "of the lower edge of its box"
        ),
        Live(),
    ] = "centre"
    quality: Annotated[int, Field(ge=1, le=100, description="JPEG quality of tracked"), Live()] = 80
    transport: FrameTransport = "auto"
    depth_min: DepthMin = None
    depth_max: DepthMax = None
    max_age: MaxAge = 0.4
    max_pixels: Annotated[
        int,
        Field(
            ge=1,
            le=7680 * 4320,
            description="width times height; larger frames are dropped. One frame needs up to 130 "
            "bytes of memory per pixel",
        ),
    ] = 1920 * 1200

    @property
    def cameras(self) -> tuple[str, ...]:
        """The names of the cameras, each once; empty for all cameras."""
        return cameras_of(self.camera)

    @model_validator(mode="after")
    def _depth_in_order(self) -> Self:
        check_depth_range(self)
        return self
