"""The edge detector's options; flags, configuration files and live parameters derive from them."""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal, Self

from pydantic import Field, model_validator

from zenoh_vision.config.parameters import Live
from zenoh_vision.config.settings import FromText, ServiceSettings


class EdgeSettings(ServiceSettings):
    """Options of ``zv edge``."""

    env_prefix: ClassVar[str] = "ZV_EDGE_"

    sigma: Annotated[
        float,
        Field(ge=0, le=20, description="Gaussian smoothing, pixels; 0: none"),
        Live("pixels"),
    ] = 1.4
    low: Annotated[
        float,
        Field(ge=0, le=100_000, description="hysteresis: gradients below it are no edge"),
        Live(),
    ] = 40.0
    high: Annotated[
        float,
        Field(ge=0, le=100_000, description="hysteresis: gradients above it are edges"),
        Live(),
    ] = 100.0
    aperture: Annotated[
        Literal[3, 5, 7],
        FromText,
        Field(description="side of the Sobel kernel, pixels"),
        Live("pixels"),
    ] = 3
    l2: Annotated[
        bool,
        Field(description="gradient magnitude sqrt(gx^2 + gy^2) instead of |gx| + |gy|"),
        Live(),
    ] = True
    format: Annotated[
        Literal["png", "jpeg"],
        Field(description="png is lossless; jpeg also has values between 0 and 255"),
        Live(),
    ] = "png"
    quality: Annotated[int, Field(ge=1, le=100, description="JPEG quality, for jpeg"), Live()] = 80
    max_age: Annotated[
        float,
        Field(ge=0.001, le=60, description="seconds; frames older than this are dropped"),
        Live("s"),
    ] = 0.4
    max_pixels: Annotated[
        int,
        Field(
            ge=1,
            le=7680 * 4320,
            description="width times height; larger frames are dropped. The memory for one is up "
            "to 30 bytes a pixel",
        ),
    ] = 4096 * 2304

    @model_validator(mode="after")
    def _thresholds_in_order(self) -> Self:
        if self.low > self.high:
            raise ValueError(
                f"low = {self.low:g} is above high = {self.high:g}; allowed: low at most high"
            )
        return self
