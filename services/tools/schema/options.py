"""The options of ``zv schema``."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from services.tools.options import Argument, ToolOptions


class SchemaOptions(ToolOptions):
    """Options of ``zv schema``."""

    name: Annotated[
        str | None,
        Argument("NAME"),
        Field(description="message, such as Centroid or vision.Centroid.v1; without it a list"),
    ] = None
