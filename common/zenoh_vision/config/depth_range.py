"""The two options of every program that converts 16 bits to 8: the values that become 1 and 255."""

from __future__ import annotations

from typing import Annotated, Protocol

from pydantic import Field

from zenoh_vision.config.parameters import Live

DepthMin = Annotated[
    int | None,
    Field(
        ge=0,
        le=65535,
        description="for pictures of 16 bits, such as depth in mm: value that becomes 1 of 255; 0 "
        "is no reading and stays 0; not set: percentile 1 of the readings",
    ),
    Live(),
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
]


class HasDepthRange(Protocol):
    """Settings with these options."""

    depth_min: int | None
    depth_max: int | None


def check_depth_range(settings: HasDepthRange) -> None:
    """Check that the two options, if both are set, are in order.

    Raises:
        ValueError: They are not.
    """
    low, high = settings.depth_min, settings.depth_max
    if low is not None and high is not None and low >= high:
        raise ValueError(
            f"depth_min = {low} is not below depth_max = {high}; allowed: depth_min below depth_max"
        )
