"""The embedded router's options: the only list of them."""

from __future__ import annotations

from typing import Annotated, ClassVar

from pydantic import Field

from common.settings import Settings


class RouterSettings(Settings):
    """Options of ``zv router``."""

    env_prefix: ClassVar[str] = "ZV_ROUTER_"

    listen: Annotated[
        str,
        Field(
            pattern=r"^(tcp|tls|udp|quic|ws|unixsock-stream)/.+$",
            description="Zenoh endpoint to listen on; tcp/0.0.0.0:7447 serves other machines, "
            "with #so_sndbuf=32768 after it those behind slow links too",
        ),
    ] = "tcp/127.0.0.1:7447"
