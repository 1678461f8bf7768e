"""Every message on the wire: one class each, with types, units and limits.

The bytes are described in docs/messages.md, with test vectors in tests/vectors.
Coordinates are full-resolution pixels, origin top left.
"""

from __future__ import annotations

from itertools import pairwise
from typing import Annotated, Any, ClassVar, Literal, Self

from pydantic import Field, ValidationError, model_validator

from common.codec import Message, explain, unpack
from common.errors import PayloadError

NAME_PATTERN = r"^[a-z0-9_]+$"
MAX_BOUNDS = 100

Name = Annotated[str, Field(pattern=NAME_PATTERN, max_length=64)]
Nanoseconds = Annotated[int, Field(ge=0, lt=2**63)]
Count = Annotated[int, Field(ge=0, lt=2**64)]
Side = Annotated[int, Field(ge=1, le=65535)]
Pixel = Annotated[int, Field(ge=-(2**31), lt=2**31)]
Box = tuple[Pixel, Pixel, Pixel, Pixel]


class Header(Message):
    """Who, which frame, when: the identity of a frame and of all that is derived from it.

    ``stamp_ns`` may be any 64-bit integer here: whether a clock can have it is judged on
    arrival, where there is a clock to compare it with.
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

    def to_map(self) -> dict[str, Any]:
        """Return the map on the wire; fields that do not apply are left out."""
        return self.model_dump(exclude_none=True)

    @classmethod
    def from_bytes(cls, payload: bytes) -> Self:
        """Decode the attachment of an image.

        Raises:
            PayloadError: ``bad_header``.
        """
        try:
            return cls.model_validate(unpack(payload))
        except ValidationError as error:
            raise PayloadError("bad_header", explain("Header", error)) from None
        except PayloadError as error:
            raise PayloadError("bad_header", error.detail) from None


class Stamped(Message):
    """Base of the messages that belong to a frame: they carry its header."""

    header: Header

    def to_map(self) -> dict[str, Any]:
        """Return the map on the wire, the header in its short form."""
        return {**self.model_dump(exclude={"header"}), "header": self.header.to_map()}


class Centroid(Stamped):
    """The largest moving object of one frame; all nil when nothing moves."""

    schema_name: ClassVar[str] = "vision.Centroid.v1"

    x: Pixel | None
    y: Pixel | None
    box: Annotated[Box | None, Field(description="x, y, width, height")]
    area: Annotated[float | None, Field(ge=0, description="contour area, square pixels")]


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
    world: tuple[float, float] | None = None


class Tracks(Stamped):
    """All moving objects of one frame."""

    schema_name: ClassVar[str] = "vision.Tracks.v1"

    tracks: tuple[Track, ...]


class TrackEvent(Stamped):
    """Something happened to a track: it started, ended, crossed a line, changed zone."""

    schema_name: ClassVar[str] = "vision.TrackEvent.v1"

    event: Annotated[str, Field(max_length=64)]
    id: Count
    zone: str | None = None
    direction: str | None = None
    x: float
    y: float


class CameraInfo(Stamped):
    """Calibration, with the fields of sensor_msgs/CameraInfo and a plane's homography."""

    schema_name: ClassVar[str] = "vision.CameraInfo.v1"

    width: Side
    height: Side
    distortion_model: str
    d: tuple[float, ...]
    k: Annotated[tuple[float, ...], Field(min_length=9, max_length=9)]
    r: Annotated[tuple[float, ...], Field(min_length=9, max_length=9)]
    p: Annotated[tuple[float, ...], Field(min_length=12, max_length=12)]
    plane: Annotated[tuple[float, ...], Field(min_length=9, max_length=9)] | None = None


class Latency(Message):
    """Milliseconds from capture, over the last seconds; nil before the first frame."""

    p50: float | None
    p99: float | None


class Histogram(Message):
    """How often a latency was at most so long, since the node's start.

    Cumulative, as Prometheus has it: each count includes those before it, and the last one,
    which has no bound, is the number of all frames.
    """

    bounds: Annotated[tuple[float, ...], Field(min_length=1, max_length=MAX_BOUNDS)]
    counts: Annotated[tuple[Count, ...], Field(min_length=2, max_length=MAX_BOUNDS + 1)]
    sum: Annotated[float, Field(ge=0)]

    @model_validator(mode="after")
    def _ordered(self) -> Self:
        if len(self.counts) != len(self.bounds) + 1:
            raise ValueError("counts must be one more than bounds")
        if any(low >= high for low, high in pairwise(self.bounds)):
            raise ValueError("bounds must rise")
        if any(low > high for low, high in pairwise(self.counts)):
            raise ValueError("counts must not fall: each includes those before it")
        return self


class Diagnostics(Message):
    """Health of one node, once a second; the counters are totals since its start."""

    schema_name: ClassVar[str] = "vision.Diagnostics.v1"

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

    def to_map(self) -> dict[str, Any]:
        """Return the map on the wire; a histogram that there is none of is left out."""
        fields = self.model_dump()
        if self.latency_histogram_ms is None:
            del fields["latency_histogram_ms"]
        return fields


class Parameter(Message):
    """One parameter of a node: what it is, what it may be, what it is for."""

    schema_name: ClassVar[str] = "vision.Parameter.v1"

    node: str
    name: str
    type: str
    value: bool | int | float | str | None
    default: bool | int | float | str | None
    minimum: float | None = None
    maximum: float | None = None
    choices: tuple[str, ...] | None = None
    unit: str | None = None
    description: str = ""
    revision: Count = 0


class ParameterList(Message):
    """All parameters of one node at one revision."""

    schema_name: ClassVar[str] = "vision.ParameterList.v1"

    node: str
    revision: Count
    parameters: tuple[Parameter, ...]


class Refusal(Message):
    """The error reply to a change of parameters that was refused; nothing has changed."""

    schema_name: ClassVar[str] = "vision.Refusal.v1"

    error: Annotated[str, Field(description="what was wrong, naming parameter and value")]
    allowed: Annotated[str, Field(description="what would have been right")]


class NodeDescription(Message):
    """Who a node is and which keys it publishes and subscribes (``Node`` in the contract)."""

    schema_name: ClassVar[str] = "vision.Node.v1"

    node: str
    service: str
    cameras: tuple[str, ...]
    version: str
    host: str
    pid: Annotated[int, Field(ge=0)]
    started_ns: Nanoseconds
    publishes: tuple[str, ...]
    subscribes: tuple[str, ...]
    stamp_ns: Annotated[
        Nanoseconds | None, Field(description="when it was answered, by the node's clock")
    ] = None
    rate_hz: Annotated[
        float | None, Field(gt=0, description="frames per second that should arrive, if known")
    ] = None

    def to_map(self) -> dict[str, Any]:
        """Return the map on the wire; fields that do not apply are left out."""
        return self.model_dump(exclude_none=True)
