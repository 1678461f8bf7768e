"""The tracker's options; flags, configuration files and live parameters derive from them."""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal

from pydantic import Field

from zenoh_vision.config.parameters import Live
from zenoh_vision.config.settings import FromText, ServiceSettings


class TrackerSettings(ServiceSettings):
    """Options of ``zv tracker``; the defaults are the tutorial's parameters."""

    env_prefix: ClassVar[str] = "ZV_TRACKER_"

    pipeline: Annotated[
        Literal["tutorial"],
        Field(description="tutorial: MOG2, closing, median, threshold, largest contour"),
        Live(),
    ] = "tutorial"
    history: Annotated[
        int,
        Field(ge=1, le=100_000, description="number of frames that form the background model"),
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
    detect_shadows: Annotated[
        bool, Field(description="mark shadows, which the threshold then removes"), Live()
    ] = True
    closing: Annotated[
        int,
        Field(ge=0, le=255, description="side of the closing kernel, pixels; 0: no closing"),
        Live("pixels"),
    ] = 20
    median: Annotated[
        Literal[0, 3, 5, 7, 9, 11, 13, 15],
        FromText,
        Field(description="side of the median filter, pixels; 0: none"),
        Live("pixels"),
    ] = 5
    threshold: Annotated[
        int, Field(ge=0, le=254, description="mask values above it are foreground"), Live()
    ] = 127
    quality: Annotated[int, Field(ge=1, le=100, description="JPEG quality of tracked"), Live()] = 80
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
            "to 130 bytes a pixel",
        ),
    ] = 1920 * 1200
