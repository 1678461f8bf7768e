"""The options of ``zv new service``."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from zenoh_vision.config.constraints import Form
from zenoh_vision.config.settings import Argument
from zv.tools.shared.options import ToolOptions


class ServiceOptions(ToolOptions):
    """Options of ``zv new service``."""

    name: Annotated[
        str,
        Argument("NAME"),
        Field(
            pattern=r"^[a-z][a-z0-9_]*$",
            max_length=40,
            description="name of the service: of its file, its topic, and its node NAME_CAMERA",
        ),
        Form("letters a-z, digits and _, a letter first"),
    ]
    folder: Annotated[
        str | None, Field(description="folder to write, which must not exist; default: NAME")
    ] = None
