"""The options of ``zv snapshot``."""

from __future__ import annotations

from pathlib import PurePath
from typing import Annotated

from pydantic import AfterValidator, Field

from zenoh_vision.config.settings import Argument, Letter
from zv.tools.shared.options import SECONDS, ToolOptions

SUFFIXES = (".jpg", ".jpeg", ".png")
STDOUT = "-"


def _known_form(name: str) -> str:
    if name != STDOUT and PurePath(name).suffix.lower() not in SUFFIXES:
        raise ValueError(f"a file name ends in {', '.join(SUFFIXES)}; - is standard output")
    return name


class SnapshotOptions(ToolOptions):
    """Options of ``zv snapshot``."""

    key: Annotated[str, Argument("KEY"), Field(description="key of a picture")]
    output: Annotated[
        str,
        Letter("o"),
        AfterValidator(_known_form),
        Field(description="file, FILE.jpg or FILE.png; - is standard output"),
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
