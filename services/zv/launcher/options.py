"""The options of ``zv up``."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from zenoh_vision.config.durations import SECONDS
from zenoh_vision.config.settings import Argument, Settings


class UpOptions(Settings):
    """Options of ``zv up``."""

    file: Annotated[
        str | None,
        Argument("FILE.toml"),
        Field(
            description="launch file; default: configs/up.toml of this folder, or else the "
            "built-in one"
        ),
    ] = None
    listen: Annotated[
        str | None,
        Field(description="endpoint on which the router listens; overrides the file"),
    ] = None
    secure: Annotated[
        str | None,
        Field(description="folder of zv security init: certificates for the router and each node"),
    ] = None
    remap: Annotated[
        tuple[str, ...],
        Field(description="OLD=NEW: run the nodes of camera OLD for camera NEW; may be repeated"),
    ] = ()
    grace: Annotated[
        float | None,
        Field(
            ge=0,
            le=3600,
            description="how long nodes may take to end before they are killed; overrides the "
            "file, whose default is 5s; a second Ctrl-C kills at once",
        ),
        SECONDS,
    ] = None
    plain: Annotated[bool, Field(description="plain lines, on a terminal too")] = False
