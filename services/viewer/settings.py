"""The viewer's options: the only list of them."""

from __future__ import annotations

from typing import Annotated, ClassVar

from pydantic import Field

from common.parameters import Live
from common.settings import Secret, Settings


class ViewerSettings(Settings):
    """Options of ``zv view``."""

    env_prefix: ClassVar[str] = "ZV_VIEWER_"

    host: Annotated[
        str,
        Field(
            min_length=1,
            max_length=255,
            description="address to serve on; any but a loopback one asks browsers for a token",
        ),
    ] = "127.0.0.1"
    port: Annotated[
        int, Field(ge=0, le=65535, description="TCP port to serve on; 0: one that is free")
    ] = 8080
    token: Annotated[
        str | None,
        Field(
            pattern=r"^[A-Za-z0-9_.~-]{16,128}$",
            description="what a browser must know; not set: none on a loopback address, elsewhere "
            "one that is made on first use and kept",
        ),
        Secret(),
    ] = None
    allow_host: Annotated[
        str,
        Field(
            pattern=r"^[A-Za-z0-9_.,-]*$",
            max_length=1000,
            description="names, with commas between, under which browsers may ask for it besides "
            "localhost, this machine's name and its addresses",
        ),
    ] = ""
    max_clients: Annotated[
        int,
        Field(ge=1, le=10_000, description="pages and streams served at once; more get 503"),
        Live(),
    ] = 100
    quality: Annotated[
        int, Field(ge=1, le=100, description="JPEG quality of what is encoded here"), Live()
    ] = 80
    max_age: Annotated[
        float,
        Field(ge=0.001, le=60, description="seconds; frames later than this are not shown"),
        Live("s"),
    ] = 1.0
    wait: Annotated[
        float,
        Field(ge=0.1, le=60, description="seconds that a snapshot waits for its picture"),
        Live("s"),
    ] = 2.0
