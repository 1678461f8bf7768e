"""The options of ``zv topic list|info|echo|hz|bw|delay|pub``."""

from __future__ import annotations

import re
from typing import Annotated, Self

from pydantic import BeforeValidator, Field, model_validator

from services.tools.options import SECONDS, SHARE, Argument, ToolOptions

DAY_S = 86400.0
BYTES = {"": 1.0, "k": 1e3, "M": 1e6, "G": 1e9}


def _bytes_per_second(value: object) -> object:
    """Turn ``2.5MB/s``, ``300kB``, ``5000`` into bytes per second; leave the rest to the model."""
    if not isinstance(value, str):
        return value
    found = re.fullmatch(r"([0-9.]+) *([kMG]?)B?(/s)?", value.strip())
    if found is None:
        raise ValueError("not a bandwidth such as 2.5MB/s, 300kB/s, 5000B/s")
    return float(found[1]) * BYTES[found[2]]


BANDWIDTH = BeforeValidator(_bytes_per_second)
"""Marks bytes per second; on the command line with or without their unit."""

Keys = Annotated[
    tuple[str, ...],
    Argument("KEY"),
    Field(
        description="key expressions, * and ** for any chunks; "
        "without one the compressed pictures of all cameras"
    ),
]
Window = Annotated[
    float,
    Field(gt=0, le=DAY_S, description="time over which the figures are taken, such as 5s"),
    SECONDS,
]
For = Annotated[
    float | None,
    Field(
        gt=0,
        le=DAY_S,
        description="measure so long from the first message on, print once, and end; "
        "the figures are of all that time",
    ),
    SECONDS,
]
Tolerance = Annotated[
    float, Field(ge=0, lt=1, description="how far off --expect it may be, such as 10%"), SHARE
]


class ListOptions(ToolOptions):
    """Options of ``zv topic list``."""

    key: Annotated[
        str | None,
        Argument("KEY"),
        Field(description="key expression; without it everything in the namespace"),
    ] = None
    window: Window = 1.0
    watch: Annotated[bool, Field(description="again and again, until Ctrl-C")] = False
    flowing: Annotated[bool, Field(description="only what flows")] = False
    all_: Annotated[
        bool,
        Field(description="subscribe to everything: makes streams flow that are made on demand"),
    ] = False


class InfoOptions(ToolOptions):
    """Options of ``zv topic info``."""

    key: Annotated[str, Argument("KEY"), Field(description="key expression")]
    window: Window = 1.0


class EchoOptions(ToolOptions):
    """Options of ``zv topic echo``."""

    key: Annotated[str, Argument("KEY"), Field(description="key expression")]
    field: Annotated[
        str | None, Field(description="only this field of each message, such as header.seq or x")
    ] = None
    count: Annotated[int | None, Field(ge=1, description="end after so many messages")] = None
    once: Annotated[bool, Field(description="end after the first message")] = False
    for_: Annotated[
        float | None, Field(gt=0, le=DAY_S, description="end after so long, such as 5s"), SECONDS
    ] = None
    header: Annotated[bool, Field(description="leave the header out")] = True
    csv: Annotated[bool, Field(description="comma-separated values, titles first")] = False


class MeasureOptions(ToolOptions):
    """What hz, bw and delay have in common."""

    keys: Keys = ()
    window: Window = 5.0
    for_: For = None
    tolerance: Tolerance = 0.1


class HzOptions(MeasureOptions):
    """Options of ``zv topic hz``."""

    expect: Annotated[
        float | None,
        Field(gt=0, le=1e6, description="exit status 1 unless each stream has this rate, Hz"),
    ] = None


class BwOptions(MeasureOptions):
    """Options of ``zv topic bw``."""

    expect: Annotated[
        float | None,
        Field(
            gt=0,
            description="exit status 1 unless each stream has this bandwidth, such as 2.5MB/s",
        ),
        BANDWIDTH,
    ] = None


class DelayOptions(MeasureOptions):
    """Options of ``zv topic delay``."""

    expect: Annotated[
        float | None,
        Field(
            gt=0, description="exit status 1 unless each stream has this mean delay, such as 20ms"
        ),
        SECONDS,
    ] = None
    at_most: Annotated[
        float | None,
        Field(gt=0, description="exit status 1 if a stream's p99 is over this delay, such as 50ms"),
        SECONDS,
    ] = None


class PubOptions(ToolOptions):
    """Options of ``zv topic pub``."""

    key: Annotated[str, Argument("KEY"), Field(description="key, without * or **")]
    data: Annotated[
        str,
        Argument("DATA"),
        Field(description="message as JSON, a file that holds one, or an image file; - reads it"),
    ]
    rate: Annotated[
        float | None,
        Field(gt=0, le=1000, description="messages per second, until Ctrl-C or --count"),
    ] = None
    count: Annotated[int | None, Field(ge=1, description="end after so many; without --rate 1")] = (
        None
    )
    type_: Annotated[
        str | None, Field(description="message type, for a key that is not in the topic table")
    ] = None
    size: Annotated[
        str | None,
        Field(
            pattern=r"^[0-9]{1,5}x[0-9]{1,5}$",
            description="frame size in the header, such as 640x480; "
            "else that of the camera's newest picture",
        ),
    ] = None

    @model_validator(mode="after")
    def _count_has_a_rate(self) -> Self:
        if self.count is not None and self.count > 1 and self.rate is None:
            raise ValueError("--count over 1 needs a --rate")
        return self
