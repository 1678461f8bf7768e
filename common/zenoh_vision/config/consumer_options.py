"""The options of every program that makes results of each frame: where it comes from, how old."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from zenoh_vision.config.durations import SECONDS
from zenoh_vision.config.parameters import Live
from zenoh_vision.keys import Transport

FrameTransport = Annotated[
    Transport,
    Field(
        description="key of the frames. jpeg: the compressed ones, JPEG or PNG; raw: the raw "
        "pixels; auto: the compressed ones if they flow, else the raw pixels"
    ),
    Live(),
]
MaxAge = Annotated[
    float,
    Field(ge=0.001, le=60, description="frames older than this are dropped"),
    Live("s"),
    SECONDS,
]
