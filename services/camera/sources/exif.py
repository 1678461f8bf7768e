"""How a camera was held, from the Exif tag of a JPEG."""

from __future__ import annotations

from typing import Final

UPRIGHT: Final = 1
ORIENTATION: Final = 0x0112
SHORT: Final = 3
ENTRY_BYTES: Final = 12
APP1: Final = b"\xff\xe1"


def orientation(jpeg: bytes) -> int:
    """Return the orientation tag of a JPEG, 1 to 8; 1 (upright) when it has none or nonsense.

    Args:
        jpeg: A whole JPEG; only its first Exif segment is looked at.
    """
    header = jpeg.find(b"Exif\0\0", 0, 1 << 16)
    if header < 4 or jpeg[header - 4 : header - 2] != APP1:
        return UPRIGHT
    tiff = jpeg[header + 6 : header - 2 + int.from_bytes(jpeg[header - 2 : header], "big")]
    order: Final = "little" if tiff[:2] == b"II" else "big"

    def number(offset: int, size: int) -> int:
        return int.from_bytes(tiff[offset : offset + size], order)

    directory = number(4, 4)
    for index in range(min(number(directory, 2), 64)):
        entry = directory + 2 + index * ENTRY_BYTES
        if number(entry, 2) == ORIENTATION and number(entry + 2, 2) == SHORT:
            value = number(entry + 8, 2)
            return value if UPRIGHT <= value <= 8 else UPRIGHT
    return UPRIGHT
