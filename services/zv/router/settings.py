"""The embedded router's options; flags and configuration files derive from them."""

from __future__ import annotations

from typing import Annotated, ClassVar

from pydantic import Field

from zenoh_vision.config.settings import Settings
from zenoh_vision.transport.endpoint_option import Endpoint


class RouterSettings(Settings):
    """Options of ``zv router``."""

    env_prefix: ClassVar[str] = "ZV_ROUTER_"

    listen: Annotated[
        Endpoint,
        Field(
            description="Zenoh endpoint to listen on; tcp/0.0.0.0:7447 serves other machines, "
            "tcp/0.0.0.0:7447#so_sndbuf=32768 also those behind slow links",
        ),
    ] = "tcp/127.0.0.1:7447"
