"""The options of ``zv top``."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from zv.tools.shared.options import SECONDS, ToolOptions


class TopOptions(ToolOptions):
    """Options of ``zv top``."""

    once: Annotated[bool, Field(description="show the nodes once and exit")] = False
    every: Annotated[
        float | None,
        Field(
            ge=0.2,
            le=3600,
            description="interval of updates; not set: 1 s on a terminal and with --json, else 5 s",
        ),
        SECONDS,
    ] = None
