"""The options of ``zv topic list|info|echo|hz|bw|delay|pub``."""

from __future__ import annotations

from typing import Annotated, Any, Literal, Self

from pydantic import Field, model_validator

from zenoh_vision.config.constraints import Form
from zenoh_vision.config.settings import Argument, Letter
from zv.tools.shared.options import SECONDS, SHARE, ToolOptions, number_with_unit

DAY_S = 86400.0
FACTORS = {"": 1.0, "k": 1e3, "M": 1e6, "G": 1e9}
BANDWIDTH = number_with_unit(
    {f"{prefix}{rest}": FACTORS[prefix] for prefix in FACTORS for rest in ("", "B", "/s", "B/s")},
    "bandwidth such as 2.5MB/s, 300kB/s, 5000B/s",
)

Key = Annotated[str, Argument("KEY"), Field(description="key expression")]
Window = Annotated[
    float,
    Field(gt=0, le=DAY_S, description="time over which the values are measured"),
    SECONDS,
]


def _expect(what: str, limit: float | None = None) -> Any:
    """Return the field of an expectation; the caller adds the marker of its unit."""
    return Field(gt=0, le=limit, description=f"exit status 1 unless each stream has this {what}")


class ListOptions(ToolOptions):
    """Options of ``zv topic list``."""

    key: Annotated[
        str | None,
        Argument("KEY"),
        Field(description="key expression; default: everything in the namespace"),
    ] = None
    window: Window = 1.0
    watch: Annotated[bool, Field(description="update the list until Ctrl-C")] = False
    flowing: Annotated[bool, Field(description="only streams that are flowing")] = False
    all_: Annotated[
        bool,
        Field(description="subscribe to everything, which starts streams produced on demand"),
    ] = False


class InfoOptions(ToolOptions):
    """Options of ``zv topic info``."""

    key: Key
    window: Window = 1.0


class EchoOptions(ToolOptions):
    """Options of ``zv topic echo``."""

    key: Key
    field: Annotated[
        tuple[str, ...],
        Field(
            description="only this field of each message, such as header.seq or x; may be given "
            "several times"
        ),
    ] = ()
    count: Annotated[int | None, Field(ge=1, description="end after this many messages")] = None
    once: Annotated[bool, Field(description="end after the first message")] = False
    for_: Annotated[
        float | None, Field(gt=0, le=DAY_S, description="end after this time"), SECONDS
    ] = None
    header: Annotated[bool, Field(description="leave the header out")] = True
    csv: Annotated[bool, Field(description="comma-separated values, titles first")] = False
    image: Annotated[bool, Field(description="draw the pictures in the terminal")] = False
    image_form: Annotated[
        Literal["auto", "kitty", "sixel", "blocks"],
        Field(
            description="how --image draws; auto: the best that the terminal says it can, else "
            "characters in 24-bit colours"
        ),
    ] = "auto"


class MeasureOptions(ToolOptions):
    """The common options of hz, bw and delay."""

    keys: Annotated[
        tuple[str, ...],
        Argument("KEY"),
        Field(
            description="key expressions, in which * and ** match any chunks; "
            "default: the compressed pictures of all cameras"
        ),
    ] = ()
    window: Window = 5.0
    for_: Annotated[
        float | None,
        Field(
            gt=0,
            le=DAY_S,
            description="measure for this time from the first message on, print the result, "
            "and end",
        ),
        SECONDS,
    ] = None
    tolerance: Annotated[
        float,
        Field(ge=0, lt=1, description="allowed deviation from --expect"),
        Form("at least 0 and below 1, or in percent, such as 10%"),
        SHARE,
    ] = 0.1

    @model_validator(mode="after")
    def _tolerance_has_an_expectation(self) -> Self:
        if "tolerance" in self.model_fields_set and getattr(self, "expect", None) is None:
            raise ValueError("--tolerance needs an --expect")
        return self


class HzOptions(MeasureOptions):
    """Options of ``zv topic hz``."""

    expect: Annotated[float | None, _expect("rate, Hz", limit=1e6)] = None


class BwOptions(MeasureOptions):
    """Options of ``zv topic bw``."""

    expect: Annotated[float | None, _expect("bandwidth, such as 2.5MB/s"), BANDWIDTH] = None


class DelayOptions(MeasureOptions):
    """Options of ``zv topic delay``."""

    expect: Annotated[float | None, _expect("mean delay"), SECONDS] = None
    at_most: Annotated[
        float | None,
        Field(gt=0, description="exit status 1 if a stream's p99 is over this delay"),
        SECONDS,
    ] = None


class PubOptions(ToolOptions):
    """Options of ``zv topic pub``."""

    key: Annotated[str, Argument("KEY"), Field(description="key, without * or **")]
    data: Annotated[
        str,
        Argument("DATA"),
        Field(description="message as JSON, a JSON file, or an image file; - reads standard input"),
    ]
    rate: Annotated[
        float | None,
        Field(gt=0, le=1000, description="messages per second, until Ctrl-C or --count"),
    ] = None
    count: Annotated[
        int | None, Field(ge=1, description="end after this many messages; 1 without --rate")
    ] = None
    wait_for: Annotated[
        int | None,
        Letter("w"),
        Field(
            ge=1,
            le=1000,
            description="wait until this many programs subscribe, without a time limit; "
            "not set: for one, up to a second",
        ),
    ] = None
    once: Annotated[
        bool,
        Letter("1"),
        Field(description="send one message as soon as a program subscribes, and end"),
    ] = False
    type_: Annotated[
        str | None,
        Field(
            description="message type, of this project or of a running node; "
            "default: that of the key"
        ),
    ] = None
    size: Annotated[
        str | None,
        Field(
            pattern=r"^[0-9]{1,5}x[0-9]{1,5}$",
            description="frame size in the header, such as 640x480; "
            "default: that of the camera's newest picture",
        ),
        Form("WIDTHxHEIGHT"),
    ] = None

    @model_validator(mode="after")
    def _once_is_alone(self) -> Self:
        if self.once and (self.count is not None or self.rate is not None):
            raise ValueError("--once sends one message, so it takes neither --count nor --rate")
        return self

    @model_validator(mode="after")
    def _count_has_a_rate(self) -> Self:
        if self.count is not None and self.count > 1 and self.rate is None:
            raise ValueError("--count over 1 needs a --rate")
        return self
