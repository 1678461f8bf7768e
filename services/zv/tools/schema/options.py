"""The options of ``zv schema``."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from zenoh_vision.config.settings import Argument
from zv.tools.shared.options import ToolOptions


class SchemaOptions(ToolOptions):
    """Options of ``zv schema``."""

    name: Annotated[
        str | None,
        Argument("NAME"),
        Field(
            description="message, such as Centroid, vision.Centroid.v1 or one of a running node; "
            "default: list all"
        ),
    ] = None
