"""The options of ``zv doctor``."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from services.tools.options import SECONDS, Argument, ToolOptions


class DoctorOptions(ToolOptions):
    """Options of ``zv doctor``."""

    files: Annotated[
        tuple[str, ...],
        Argument("FILE"),
        Field(
            description="configuration files to check: a service's or a launch file (.toml), "
            "Zenoh's (.json5); none given: those in configs/"
        ),
    ] = ()
    for_: Annotated[
        float, Field(ge=1.2, le=3600, description="how long rates and losses are watched"), SECONDS
    ] = 3.0
