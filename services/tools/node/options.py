"""The options of ``zv node list`` and ``zv node info``."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from services.tools.options import Argument, ToolOptions


class ListOptions(ToolOptions):
    """Options of ``zv node list``."""

    watch: Annotated[bool, Field(description="say who comes and goes until Ctrl-C")] = False


class InfoOptions(ToolOptions):
    """Options of ``zv node info``."""

    node: Annotated[
        str,
        Argument("NODE"),
        Field(
            pattern=r"^[a-z0-9_*?]+$", description="name; * and ? stand for any part or character"
        ),
    ]
