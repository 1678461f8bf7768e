"""The viewer's options; flags, configuration files and live parameters derive from them."""

from __future__ import annotations

from typing import Annotated, ClassVar
from urllib.parse import urlsplit

from pydantic import Field

from zenoh_vision.config.parameters import Live
from zenoh_vision.config.settings import Secret, Settings

TOKEN_PATTERN = r"^[A-Za-z0-9_.~-]{16,128}$"  # noqa: S105 - no token


class ViewerSettings(Settings):
    """Options of ``zv view``."""

    env_prefix: ClassVar[str] = "ZV_VIEWER_"

    host: Annotated[
        str,
        Field(
            min_length=1,
            max_length=255,
            description="address to serve on; all but loopback addresses require a token",
        ),
    ] = "127.0.0.1"
    port: Annotated[
        int, Field(ge=0, le=65535, description="TCP port to serve on; 0: any free port")
    ] = 8080
    address: Annotated[
        str,
        Field(
            pattern=r"^(https?://[A-Za-z0-9_.\[\]:-]+/?)?$",
            max_length=300,
            description="URL at which browsers reach the viewer, if it differs from host and port, "
            "as outside a container; it is printed, and its host name is allowed",
        ),
    ] = ""
    token: Annotated[
        str | None,
        Field(
            pattern=TOKEN_PATTERN,
            description="token that browsers must present, which permits control; another, made "
            "from it and printed too, permits viewing only; not set: none if all addresses are "
            "loopback, else one that is generated on first use and kept",
        ),
        Secret(),
    ] = None
    allow_host: Annotated[
        str,
        Field(
            pattern=r"^[A-Za-z0-9_.,-]*$",
            max_length=1000,
            description="host names under which browsers with the token may reach the viewer, "
            "separated by commas, besides this machine's name and its addresses; a name that is "
            "not loopback makes the token required",
        ),
    ] = ""
    max_clients: Annotated[
        int,
        Field(ge=1, le=10_000, description="pages and streams served at once; more get 503"),
        Live(),
    ] = 100
    quality: Annotated[
        int,
        Field(ge=1, le=100, description="JPEG quality of pictures that the viewer encodes"),
        Live(),
    ] = 80
    max_age: Annotated[
        float,
        Field(ge=0.001, le=60, description="seconds; frames older than this are not shown"),
        Live("s"),
    ] = 1.0
    wait: Annotated[
        float,
        Field(ge=0.1, le=60, description="seconds that a snapshot waits for its picture"),
        Live("s"),
    ] = 2.0
    max_pixels: Annotated[
        int,
        Field(
            ge=1,
            le=7680 * 4320,
            description="width times height; larger frames are not shown. The memory to render "
            "two at once is up to 33 bytes a pixel",
        ),
    ] = 4096 * 2304

    @property
    def names(self) -> list[str]:
        """Names besides ``host`` under which browsers reach the viewer, in lower case."""
        given = (*self.allow_host.split(","), urlsplit(self.address).hostname)
        return [name.lower() for name in given if name]
