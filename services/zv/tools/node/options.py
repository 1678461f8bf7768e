"""The options of the commands of ``zv node``."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from zenoh_vision.config.constraints import Form
from zenoh_vision.config.settings import Argument
from zv.tools.shared.options import ToolOptions


class ListOptions(ToolOptions):
    """Options of ``zv node list``."""

    watch: Annotated[bool, Field(description="print nodes that start and end, until Ctrl-C")] = (
        False
    )


class ControlOptions(ToolOptions):
    """Options of ``zv node stop``, ``start`` and ``restart``."""

    node: Annotated[
        str,
        Argument("NODE"),
        Field(pattern=r"^[a-z0-9_]+$", max_length=200, description="name of a node of zv up"),
        Form("letters a-z, digits and _"),
    ]


class InfoOptions(ToolOptions):
    """Options of ``zv node info``."""

    node: Annotated[
        str,
        Argument("NODE"),
        Field(
            pattern=r"^[a-z0-9_*?]+$", description="name; * matches any characters, ? one character"
        ),
        Form("letters a-z, digits, _, * and ?"),
    ]
