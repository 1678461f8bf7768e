"""The options of ``zv camera --list``."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from zenoh_vision.config.settings import Settings


class ListOptions(Settings):
    """Flags with which ``zv camera`` lists the devices of this machine instead of publishing."""

    list_: Annotated[
        bool,
        Field(
            description="list the devices of this machine by paths that stay the same, with their "
            "formats, sizes, rates and controls"
        ),
    ] = False
    json_: Annotated[bool, Field(description="with --list: print JSON, one object per device")] = (
        False
    )
