"""The largest pictures that are read or made; tools that decode none load these without OpenCV."""

from __future__ import annotations

from typing import Final

MAX_PIXELS: Final = 7680 * 4320
MAX_SIDE: Final = 65_500
"""libjpeg's limit of a side, pixels."""

MAX_PIXEL_BYTES: Final = 4
MAX_RAW_BYTES: Final = MAX_PIXELS * MAX_PIXEL_BYTES
