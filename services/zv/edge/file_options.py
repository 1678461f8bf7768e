"""The flags of ``zv edge`` for image files."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from zenoh_vision.config.settings import Letter, Settings

FileName = Annotated[str, Field(min_length=1)]


class FileOptions(Settings):
    """The files that ``zv edge`` reads and writes; all settings of ``zv edge`` apply too."""

    image: Annotated[
        FileName | None,
        Field(
            description="find the edges of this image, of each image of this folder, or of each "
            "frame of this video or recording"
        ),
    ] = None
    out: Annotated[
        FileName | None,
        Letter("o"),
        Field(
            description="edge map: FILE.png, FILE.jpg or FILE.bits; a folder if --image is more "
            "than an image, with files by --format"
        ),
    ] = None
    stages: Annotated[
        FileName | None,
        Field(
            description="folder for the detector's steps, STEP.png; NAME/STEP.png if --image is a "
            "folder"
        ),
    ] = None
    strength: Annotated[
        FileName | None,
        Field(
            description="strength of each edge pixel after thinning and before any threshold, 16 "
            "bits: FILE.png; a folder if --image is one"
        ),
    ] = None
