"""The messages, each a class with types, units and limits.

docs/messages.md describes their bytes, tests/vectors has test vectors. Coordinates are
full-resolution pixels, origin top left.
"""

from __future__ import annotations

from enum import IntEnum
from functools import partial
from operator import is_
from typing import Annotated, Any, ClassVar, Final, Literal, Self, TypeVar

from pydantic import Field, ValidationError, model_validator

from zenoh_vision.errors import PayloadError
from zenoh_vision.message_codec import Message, first_error, unpack

MAX_BOUNDS = 100
MAX_ROUTES = 100
"""Most inputs of a node whose routes are reported."""
MAX_COUNT = 2**64 - 1

Name = Annotated[str, Field(pattern=r"^[a-z0-9_]+$", max_length=64)]
Nanoseconds = Annotated[int, Field(ge=0, lt=2**63)]
Count = Annotated[int, Field(ge=0, le=MAX_COUNT)]
Side = Annotated[int, Field(ge=1, le=65535)]
Pixel = Annotated[int, Field(ge=-(2**31), lt=2**31)]
Box = Annotated[tuple[Pixel, Pixel, Pixel, Pixel], Field(strict=False)]
"""Here as for all tuples, ``strict`` concerns the numbers, and a list may be given too."""

Pair = Annotated[tuple[float, float], Field(strict=False)]

ClassName = Annotated[str, Field(max_length=64)]
Share = Annotated[float, Field(ge=0, le=1)]

T = TypeVar("T")
Many = Annotated[tuple[T, ...], Field(fail_fast=True, strict=False)]
"""Any number of items. Checking ends at the first wrong one: 64 kB of wrong items took 0.3 s."""


class Level(IntEnum):
    """State of a node, as in diagnostic_msgs/DiagnosticStatus."""

    OK = 0
    WARN = 1
    ERROR = 2
    STALE = 3


SEVERITY: Final[dict[int, int]] = {Level.OK: 0, Level.WARN: 1, Level.STALE: 2, Level.ERROR: 3}
"""Rank of the levels, the least serious first: no input is less serious than a failure."""


class Header(Message):
    """Identity of a frame and of all data derived from it: camera, number, capture time.

    ``stamp_ns`` may be any 64-bit integer here: receivers check on arrival whether it is
    plausible by their clock.
    """

    schema_name: ClassVar[str] = "vision.Header.v1"

    camera: Name
    epoch: Annotated[int, Field(ge=-(2**63), lt=2**63, description="start of the source's run, ns")]
    seq: Annotated[Count, Field(description="capture number within the epoch, from 0")]
    stamp_ns: Annotated[int, Field(ge=-(2**63), lt=2**63, description="capture time, ns")]
    width: Annotated[Side, Field(description="full-resolution frame width, pixels")]
    height: Annotated[Side, Field(description="full-resolution frame height, pixels")]
    encoding: Annotated[str, Field(max_length=32)] | None = None
    node: Annotated[str, Field(max_length=128)] = ""
    revision: Count = 0
    received_ns: int | None = None
    done_ns: int | None = None
    assumed: Annotated[
        bool | None,
        Field(description="true if the sender gave no header and the receiver made this one up"),
    ] = None
    replay: Annotated[
        Nanoseconds | None,
        Field(description="start of the replay's pass, ns; new after each jump; nil: not a replay"),
    ] = None
    replayed_ns: Annotated[
        Nanoseconds | None, Field(description="when the replay sent it, by its clock, ns")
    ] = None
    lockstep: Annotated[
        bool | None,
        Field(description="true if its sender waits for the answer to it, so that it is not stale"),
    ] = None
    origin: Annotated[
        Name | None,
        Field(description="camera that took it, where a relay sends it as that of another"),
    ] = None
    rotated: Annotated[
        int | None,
        Field(
            ge=90,
            le=270,
            multiple_of=90,
            description="degrees clockwise by which it is rotated since the camera's start",
        ),
    ] = None
    mirrored: Annotated[
        bool | None,
        Field(description="true if it is then mirrored left to right, since the camera's start"),
    ] = None

    @property
    def run(self) -> tuple[int, int]:
        """The run of frames that it belongs to: later runs compare higher.

        A run is an epoch; each pass of a replay repeats the epochs that were recorded.
        """
        return (self.epoch if self.replay is None else self.replay, self.epoch)

    @property
    def age_start_ns(self) -> int:
        """The time from which its age counts, ns: its capture; of a replay, when it was sent."""
        return self.stamp_ns if self.replayed_ns is None else self.replayed_ns

    def to_map(self) -> dict[str, Any]:
        """Return the fields that are not nil as they are; they are flat, so none is converted."""
        return {name: value for name, value in self.__dict__.items() if value is not None}

    @classmethod
    def from_bytes(cls, payload: bytes) -> Self:
        """Decode the attachment of an image.

        Raises:
            PayloadError: ``bad_header``.
        """
        try:
            return super().from_bytes(payload)
        except PayloadError as error:
            raise PayloadError("bad_header", error.detail) from None

    @classmethod
    def arrived(cls, payload: bytes, received_ns: int) -> Self:
        """Decode the attachment of an image that arrived at a time, which becomes part of it.

        Raises:
            PayloadError: ``bad_header``.
        """
        try:
            fields = unpack(payload)
            if isinstance(fields, dict) and type(fields.get("received_ns")) in (int, type(None)):
                fields["received_ns"] = received_ns
            return cls.model_validate(fields)
        except PayloadError as error:
            raise PayloadError("bad_header", error.detail) from None
        except ValidationError as error:
            raise PayloadError("bad_header", first_error(cls.__name__, error)) from None


class Stamped(Message):
    """Base of the messages that belong to a frame: they carry its header."""

    header: Header

    def to_map(self) -> dict[str, Any]:
        """Return the map on the wire, with the header in its short form."""
        return {**self._sent({"header"}), "header": self.header.to_map()}


class Centroid(Stamped):
    """The largest moving object of one frame; all nil when nothing moves."""

    schema_name: ClassVar[str] = "vision.Centroid.v1"

    x: Pixel | None
    y: Pixel | None
    box: Annotated[Box | None, Field(description="x, y, width, height")]
    area: Annotated[float | None, Field(ge=0, description="contour area, square pixels")]


is_none = partial(is_, None)
"""Tells that a field is nil, and thus not sent."""


class Track(Message):
    """One moving object of one frame."""

    id: Count
    state: Literal["tentative", "confirmed", "lost"]
    x: float
    y: float
    box: Box
    area: Annotated[float, Field(ge=0)]
    vx: Annotated[float, Field(description="pixels per second")] = 0.0
    vy: Annotated[float, Field(description="pixels per second")] = 0.0
    age_s: Annotated[float, Field(ge=0)] = 0.0
    missing_s: Annotated[float, Field(ge=0)] = 0.0
    world: Pair | None = None
    class_name: Annotated[
        ClassName | None,
        Field(alias="class", exclude_if=is_none, description="what a model says that it is"),
    ] = None
    score: Annotated[
        Share | None,
        Field(exclude_if=is_none, description="how sure the model was when it last found it"),
    ] = None


class ZoneCount(Message):
    """Stays in a zone since its shape was last changed, and the objects that are in it now."""

    entered: Count = 0
    left: Count = 0
    dwelled: Count = 0
    inside: Count = 0


class LineCount(Message):
    """Crossings of a line since it was last changed, by the side to which the objects went."""

    left: Count = 0
    right: Count = 0


class Tracks(Stamped):
    """All moving objects of one frame, and the counts of zones and lines after it."""

    schema_name: ClassVar[str] = "vision.Tracks.v1"
    omit_nil: ClassVar[tuple[str, ...]] = ("zones", "lines")

    tracks: Many[Track]
    zones: Annotated[dict[str, ZoneCount], Field(max_length=100)] | None = None
    lines: Annotated[dict[str, LineCount], Field(max_length=100)] | None = None


class TrackEvent(Stamped):
    """An event of a track: it started, ended, crossed a line, entered or left a zone."""

    schema_name: ClassVar[str] = "vision.TrackEvent.v1"
    omit_nil: ClassVar[tuple[str, ...]] = (
        "stamp_ns",
        "count",
        "inside",
        "dwell_s",
        "world",
        "class",
        "score",
    )

    event: Annotated[str, Field(max_length=64)]
    id: Count
    zone: Annotated[str | None, Field(description="name of the zone or line")] = None
    direction: Annotated[
        str | None, Field(description="left or right: the side of the line to which it went")
    ] = None
    x: float
    y: float
    stamp_ns: Annotated[
        int | None,
        Field(ge=-(2**63), lt=2**63, description="when it happened, between two frames, ns"),
    ] = None
    count: Annotated[
        Count | None, Field(description="such events of the zone or line and direction so far")
    ] = None
    inside: Annotated[Count | None, Field(description="objects in the zone after it")] = None
    dwell_s: Annotated[float | None, Field(ge=0, description="stay in the zone so far")] = None
    world: Pair | None = None
    class_name: Annotated[
        ClassName | None, Field(alias="class", description="what a model says that it is")
    ] = None
    score: Annotated[
        Share | None, Field(description="how sure the model was when it last found it")
    ] = None


class CameraInfo(Stamped):
    """Calibration, with the fields of sensor_msgs/CameraInfo and a plane's homography."""

    schema_name: ClassVar[str] = "vision.CameraInfo.v1"

    width: Side
    height: Side
    distortion_model: str
    d: Many[float]
    k: Annotated[Many[float], Field(min_length=9, max_length=9)]
    r: Annotated[Many[float], Field(min_length=9, max_length=9)]
    p: Annotated[Many[float], Field(min_length=12, max_length=12)]
    plane: Annotated[Many[float], Field(min_length=9, max_length=9)] | None = None


class Prediction(Stamped):
    """Where an object will be at a stamp, with standard deviations: the answer to a query.

    The header is that of the newest frame that the tracker knew. The fields of the world are nil
    without a plane.
    """

    schema_name: ClassVar[str] = "vision.Prediction.v1"

    id: Count
    state: Literal["tentative", "confirmed", "lost"]
    stamp_ns: Annotated[Nanoseconds, Field(description="for which it is predicted")]
    x: Annotated[float, Field(description="centre, full-resolution pixels")]
    y: float
    vx: Annotated[float, Field(description="pixels per second")]
    vy: float
    sigma: Annotated[Pair, Field(description="standard deviations of x and y, pixels")]
    world: Annotated[Pair | None, Field(description="X, Y in the units of the calibration")] = None
    world_velocity: Annotated[Pair | None, Field(description="units per second")] = None
    world_sigma: Annotated[
        Pair | None, Field(description="standard deviations of X and Y, units")
    ] = None


class Contour(Message):
    """One line of an edge map, simplified."""

    points: Annotated[Many[tuple[Pixel, Pixel]], Field(description="x, y along the line")]
    length: Annotated[float, Field(ge=0, description="before it was simplified, pixels")]
    closed: Annotated[bool, Field(description="the last point is joined to the first")]


class Contours(Stamped):
    """Edges of one frame as polylines, straight segments and circles, the longest first."""

    schema_name: ClassVar[str] = "vision.Contours.v1"

    density: Annotated[
        float, Field(ge=0, le=1, description="share of the pixels looked at that are edges")
    ]
    contours: Many[Contour]
    omitted: Annotated[Count, Field(description="number of further contours that were left out")]
    segments: Annotated[
        Many[tuple[float, float, float, float]], Field(description="x1, y1, x2, y2")
    ]
    circles: Annotated[
        Many[tuple[float, float, float]] | None,
        Field(description="x, y, radius; nil if they were not looked for"),
    ] = None


class ReplayMark(Message):
    """An event in a recording."""

    at_s: Annotated[float, Field(ge=0, description="since the begin of the recording")]
    event: Annotated[str, Field(max_length=64)]
    zone: Annotated[str | None, Field(max_length=256)] = None


class Replay(Message):
    """What a player plays and where it is, a few times a second."""

    schema_name: ClassVar[str] = "vision.Replay.v1"

    node: Annotated[str, Field(description="the player, whose parameters control it")]
    file: Annotated[str, Field(max_length=256)]
    begin_ns: Annotated[Nanoseconds, Field(description="when the recording begins")]
    length_s: Annotated[float, Field(ge=0)]
    position_s: Annotated[float, Field(ge=0, description="since the begin")]
    speed: Annotated[float, Field(ge=0, description="0: as fast as possible")]
    paused: bool
    loop: bool
    step: Annotated[Count, Field(description="value of the parameter; the next one steps")]
    marks: Annotated[Many[ReplayMark], Field(max_length=1000, description="recorded events")]


class Latency(Message):
    """Milliseconds from capture, over the last seconds; nil before the first frame."""

    p50: float | None
    p99: float | None


class Histogram(Message):
    """Histogram of the latencies since the node's start.

    It is cumulative, as in Prometheus: each count includes those before it, and the last one,
    which has no bound, is the number of all frames.
    """

    bounds: Annotated[Many[float], Field(min_length=1, max_length=MAX_BOUNDS)]
    counts: Annotated[Many[Count], Field(min_length=2, max_length=MAX_BOUNDS + 1)]
    sum: Annotated[float, Field(ge=0)]

    @model_validator(mode="after")
    def _ordered(self) -> Self:
        if len(self.counts) != len(self.bounds) + 1:
            raise ValueError("counts must be one more than bounds")
        if list(self.bounds) != sorted({*self.bounds}):
            raise ValueError("bounds must rise")
        if list(self.counts) != sorted(self.counts):
            raise ValueError("counts must not fall: each includes those before it")
        return self


class Diagnostics(Message):
    """Health of one node, once a second; the counters are totals since its start."""

    schema_name: ClassVar[str] = "vision.Diagnostics.v1"
    omit_nil: ClassVar[tuple[str, ...]] = ("latency_histogram_ms", "routes", "source_lag_ms")

    node: str
    stamp_ns: Nanoseconds
    level: Annotated[int, Field(ge=0, le=3, description="0 OK, 1 WARN, 2 ERROR, 3 STALE")]
    message: str
    uptime_s: Annotated[float, Field(ge=0)]
    counters: dict[str, Count]
    rate_hz: Annotated[float, Field(ge=0)]
    latency_ms: Latency
    latency_histogram_ms: Annotated[
        Histogram | None, Field(description="latencies since the start, cumulative")
    ] = None
    routes: Annotated[
        dict[str, str] | None,
        Field(
            description="how its frames come, by key: shm (shared memory), jpeg or raw (Zenoh)",
            max_length=MAX_ROUTES,
        ),
    ] = None
    source_lag_ms: Annotated[
        float | None,
        Field(description="a camera: age of the newest picture when it came from the source"),
    ] = None


class Parameter(Message):
    """One parameter of a node: its value, type, limits, unit and meaning."""

    schema_name: ClassVar[str] = "vision.Parameter.v1"

    node: str
    name: str
    type: str
    value: bool | int | float | str | None
    default: bool | int | float | str | None
    minimum: float | None = None
    maximum: float | None = None
    choices: Many[str] | None = None
    unit: str | None = None
    description: str = ""
    revision: Count = 0
    step: Annotated[
        float | None, Field(exclude_if=is_none, description="steps of the value, if above 1")
    ] = None
    flags: Annotated[
        Many[str] | None,
        Field(
            exclude_if=is_none,
            description="read_only, write_only, inactive (without effect now), volatile (changed "
            "by the device itself), grabbed (locked now)",
        ),
    ] = None


class ParameterList(Message):
    """All parameters of one node at one revision."""

    schema_name: ClassVar[str] = "vision.ParameterList.v1"

    node: str
    revision: Count
    parameters: Many[Parameter]


class Refusal(Message):
    """The error reply to a change of parameters that was refused; nothing has changed."""

    schema_name: ClassVar[str] = "vision.Refusal.v1"

    error: Annotated[str, Field(description="what was wrong, naming parameter and value")]
    allowed: Annotated[str, Field(description="what is allowed")]


class NodeDescription(Message):
    """Description of a node, with the keys that it publishes and subscribes to (``Node``)."""

    schema_name: ClassVar[str] = "vision.Node.v1"
    omit_nil: ClassVar[tuple[str, ...]] = ("stamp_ns", "rate_hz", "pipeline")

    node: str
    service: str
    cameras: Many[str]
    version: str
    host: str
    pid: Annotated[int, Field(ge=0)]
    started_ns: Nanoseconds
    publishes: Many[str]
    subscribes: Many[str]
    stamp_ns: Annotated[
        Nanoseconds | None, Field(description="when it was answered, by the node's clock")
    ] = None
    rate_hz: Annotated[
        float | None, Field(gt=0, description="frames per second that should arrive, if known")
    ] = None
    pipeline: Annotated[
        str | None, Field(description="by which of several ways it works, if it has a choice")
    ] = None


MESSAGES: Final[dict[str, type[Message]]] = {
    message.schema_name: message
    for message in list(globals().values())
    if isinstance(message, type) and issubclass(message, Message) and message.schema_name
}
"""Every message class of this module by the name of its schema."""


def known_message(name: str) -> type[Message] | None:
    """Return a message's class by its short or versioned name, in any case; None if unknown."""
    for message in MESSAGES.values():
        if name.lower() in (message.short_name().lower(), message.schema_name.lower()):
            return message
    return None
