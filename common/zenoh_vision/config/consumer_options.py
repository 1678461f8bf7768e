"""The options of every program that processes frames: their transport, age, and depth in 8 bits.

Of pictures with 16 bits, ``depth_min`` and ``depth_max`` are the values that become 1 and 255.
"""

from __future__ import annotations

from typing import Annotated, Protocol, TypeVar

from pydantic import Field

from zenoh_vision.config.durations import SECONDS
from zenoh_vision.config.parameters import Live
from zenoh_vision.config.roles import Role
from zenoh_vision.config.settings import Shared
from zenoh_vision.keys import TRANSPORT_VARIABLE, Transport

FrameTransport = Annotated[
    Transport,
    Field(
        description="how frames come. shm: through shared memory, from a camera on the same "
        "machine; jpeg: compressed, JPEG or PNG, over the network; raw: as raw pixels over the "
        "network; auto: shm if possible, else jpeg if the camera publishes it, else raw"
    ),
    Shared(TRANSPORT_VARIABLE),
    Live(),
    Role("transport"),
]
MaxAge = Annotated[
    float,
    Field(ge=0.001, le=60, description="frames older than this are dropped"),
    Live("s"),
    Role("max_age"),
    SECONDS,
]
DepthMin = Annotated[
    int | None,
    Field(
        ge=0,
        le=65535,
        description="for pictures of 16 bits, such as depth in mm: value that becomes 1 of 255; 0 "
        "is no reading and stays 0; not set: percentile 1 of the readings",
    ),
    Live(),
    Role("depth_min"),
]
DepthMax = Annotated[
    int | None,
    Field(
        ge=0,
        le=65535,
        description="for pictures of 16 bits: value that becomes 255; not set: percentile 99 of "
        "the readings",
    ),
    Live(),
    Role("depth_max"),
]


class HasDepthRange(Protocol):
    """Settings with these options."""

    depth_min: int | None
    depth_max: int | None


D = TypeVar("D", bound=HasDepthRange)


def check_depth_range(settings: D) -> D:
    """Check that the two options, if both are set, are in order; a validator of settings.

    Raises:
        ValueError: They are not.
    """
    low, high = settings.depth_min, settings.depth_max
    if low is not None and high is not None and low >= high:
        raise ValueError(
            f"depth_min = {low} is not below depth_max = {high}; allowed: depth_min below depth_max"
        )
    return settings
