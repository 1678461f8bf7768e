"""The eight ways to turn a picture: rotated by quarters, and mirrored or not. Arithmetic only.

Coordinates count from the top left corner of the top left pixel, and y points down.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

from zenoh_vision.messages import Box, Header

Size = tuple[int, int]
"""Width and height, pixels."""

Point = tuple[float, float]


@dataclass(frozen=True, slots=True)
class Turn:
    """A rotation clockwise, then left and right are exchanged or not.

    Attributes:
        degrees: 0, 90, 180 or 270.
        mirrored: Whether left and right are exchanged.
    """

    degrees: int = 0
    mirrored: bool = False

    @classmethod
    def of(cls, rotate: int, flip: str) -> Self:
        """Return that of a camera's options: rotated clockwise, then flipped."""
        half = 180 if flip in ("vertical", "both") else 0
        return cls((rotate + half) % 360, flip in ("horizontal", "vertical"))

    @classmethod
    def of_header(cls, header: Header) -> Self:
        """Return how a frame is turned since its camera was started."""
        return cls(header.rotated or 0, bool(header.mirrored))

    @property
    def inverse(self) -> Turn:
        """The way back."""
        return Turn().since(self)

    def since(self, before: Turn) -> Turn:
        """Return how a picture that was turned in one way must be turned further for this way."""
        degrees = self.degrees - before.degrees
        if before.mirrored:  # a mirrored picture must be rotated the other way round
            degrees = -degrees
        return Turn(degrees % 360, self.mirrored != before.mirrored)

    def size(self, size: Size) -> Size:
        """Return the size of the turned picture."""
        return size if self.degrees % 180 == 0 else (size[1], size[0])

    def vector(self, x: float, y: float) -> Point:
        """Return a displacement, such as a velocity, in the turned picture."""
        for _ in range(self.degrees // 90):
            x, y = -y, x
        return (-x if self.mirrored else x), y

    def point(self, x: float, y: float, size: Size) -> Point:
        """Return where a point of a picture of a size is in the turned one."""
        width, height = self.size(size)
        x, y = self.vector(x - size[0] / 2, y - size[1] / 2)
        return x + width / 2, y + height / 2

    def box(self, box: Box, size: Size) -> Box:
        """Return where a rectangle of a picture of a size is in the turned one."""
        x, y, width, height = box
        corners = self.point(x, y, size), self.point(x + width, y + height, size)
        (left, right), (top, bottom) = (
            sorted(map(int, each)) for each in zip(*corners, strict=True)
        )
        return left, top, right - left, bottom - top

    def __str__(self) -> str:
        """Return it in words."""
        rotated = f"rotated by {self.degrees} degrees" if self.degrees else ""
        return (
            " and ".join(filter(None, [rotated, "mirrored" if self.mirrored else ""]))
            or "as it was"
        )
