"""The options of every program that makes results of each frame: where it comes from, how old."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from zenoh_vision.config.durations import SECONDS
from zenoh_vision.config.parameters import Live
from zenoh_vision.config.settings import Shared
from zenoh_vision.keys import TRANSPORT_VARIABLE, Transport

FrameTransport = Annotated[
    Transport,
    Field(
        description="way of the frames. shm: shared memory of one machine; jpeg: the compressed "
        "ones over the network, JPEG or PNG; raw: the raw pixels over the network; auto: shared "
        "memory if camera and service have it in common, else the compressed ones if they flow, "
        "else the raw pixels"
    ),
    Shared(TRANSPORT_VARIABLE),
    Live(),
]
MaxAge = Annotated[
    float,
    Field(ge=0.001, le=60, description="frames older than this are dropped"),
    Live("s"),
    SECONDS,
]
