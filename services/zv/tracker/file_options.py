"""The flags of ``zv track``."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from zenoh_vision.config.settings import Argument, Letter, Settings
from zv.tracker.settings import FileName


class FileOptions(Settings):
    """The files that ``zv track`` reads and writes; all settings of ``zv tracker`` apply too."""

    file: Annotated[
        FileName,
        Argument("FILE"),
        Field(description="video, recording or folder of images whose objects are tracked"),
    ] = None
    image: Annotated[FileName, Field(description="find the objects of this image by --model")] = (
        None
    )
    out: Annotated[
        FileName,
        Letter("o"),
        Field(
            description="of a FILE, its tracks: .csv, or .txt in the format of MOTChallenge; of "
            "an image, the image with its boxes: .png or .jpg, by default NAME_boxes.jpg"
        ),
    ] = None
