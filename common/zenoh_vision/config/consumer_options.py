"""The options of every program that processes frames: their transport and their greatest age."""

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
        description="how frames come. shm: through shared memory, from a camera on the same "
        "machine; jpeg: compressed, JPEG or PNG, over the network; raw: as raw pixels over the "
        "network; auto: shm if possible, else jpeg if the camera publishes it, else raw"
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
