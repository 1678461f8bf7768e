"""The tracker's options: the only list of them."""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal

from pydantic import Field

from common.parameters import Live
from common.settings import FromText, ServiceSettings


class TrackerSettings(ServiceSettings):
    """Options of ``zv tracker``; the defaults are the tutorial's numbers."""

    env_prefix: ClassVar[str] = "ZV_TRACKER_"

    pipeline: Annotated[
        Literal["tutorial"],
        Field(description="tutorial: MOG2, closing, median, threshold, largest contour"),
        Live(),
    ] = "tutorial"
    history: Annotated[
        int,
        Field(ge=1, le=100_000, description="frames that make the background model"),
        Live("frames"),
    ] = 700
    var_threshold: Annotated[
        float,
        Field(
            ge=0.01,
            le=10_000,
            description="squared Mahalanobis distance from the background that is foreground",
        ),
        Live(),
    ] = 25.0
    detect_shadows: Annotated[
        bool, Field(description="mark shadows, so that they drop out"), Live()
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
        Field(ge=0.001, le=60, description="seconds; frames later than this are dropped"),
        Live("s"),
    ] = 0.4
