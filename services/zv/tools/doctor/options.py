"""The options of ``zv doctor``."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from zenoh_vision.config.settings import Argument
from zv.tools.shared.options import SECONDS, ToolOptions


class DoctorOptions(ToolOptions):
    """Options of ``zv doctor``."""

    files: Annotated[
        tuple[str, ...],
        Argument("FILE"),
        Field(
            description="configuration files to check: of a service, launch files (.toml), "
            "of Zenoh (.json5); default: those in the folder configs/ here, if there is one"
        ),
    ] = ()
    expect: Annotated[
        str | None,
        Field(description="launch file whose nodes must run; each that does not is a FAIL"),
    ] = None
    remap: Annotated[
        tuple[str, ...],
        Field(
            description="with --expect, OLD=NEW as for zv up: its nodes of camera OLD run for "
            "camera NEW; may be given several times"
        ),
    ] = ()
    for_: Annotated[
        float, Field(ge=1.2, le=3600, description="how long to observe rates and losses"), SECONDS
    ] = 3.0
