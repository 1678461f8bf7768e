"""The form of every option that selects a rectangle of each frame: X,Y,WIDTH,HEIGHT."""

from __future__ import annotations

from functools import lru_cache
from typing import Final

from zenoh_vision.config.constraints import Form
from zenoh_vision.messages import Box

REGION_PATTERN: Final = r"^([0-9]{1,5},[0-9]{1,5},[1-9][0-9]{0,4},[1-9][0-9]{0,4})?$"
REGION_FORM: Final = Form(
    "whole numbers X,Y,WIDTH,HEIGHT without blanks, WIDTH and HEIGHT at least 1, or empty"
)


@lru_cache(maxsize=8)  # services ask for each frame
def box_of(region: str) -> Box | None:
    """Return the rectangle of a text of this form; None for the whole frame, an empty text."""
    if not region:
        return None
    x, y, width, height = map(int, region.split(","))
    return x, y, width, height
