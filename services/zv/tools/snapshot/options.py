"""The options of ``zv snapshot``."""

from __future__ import annotations

from pathlib import PurePath
from typing import Annotated

from pydantic import AfterValidator, Field

from zenoh_vision.config.constraints import Form
from zenoh_vision.config.settings import Argument, Letter
from zv.tools.shared.options import SECONDS, ToolOptions

SUFFIXES = (".jpg", ".jpeg", ".png")
STDOUT = "-"


def _known_form(name: str) -> str:
    if name != STDOUT and PurePath(name).suffix.lower() not in SUFFIXES:
        raise ValueError("its ending names no format")
    return name


class SnapshotOptions(ToolOptions):
    """Options of ``zv snapshot``."""

    key: Annotated[str, Argument("KEY"), Field(description="key of a picture")]
    output: Annotated[
        str,
        Letter("o"),
        AfterValidator(_known_form),
        Form(f"a name that ends in {', '.join(SUFFIXES)}; or -"),
        Field(description="file to write; - is standard output"),
    ]
    draw: Annotated[
        bool, Field(description="draw the tracks or the centroid of the same frame on the picture")
    ] = False
    quality: Annotated[
        int, Field(ge=1, le=100, description="JPEG quality, if the picture must be encoded")
    ] = 90
    max_age: Annotated[
        float | None,
        Field(gt=0, description="exit status 1 if the picture is older than this"),
        SECONDS,
    ] = None
