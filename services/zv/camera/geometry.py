"""How a frame shows what the source saw: rotated, mirrored, cut out. Arithmetic only.

The coordinates of a frame are those of its pixels after these steps. What is drawn, measured or
calibrated in the source's picture is brought there by the same ``Geometry``.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Final

from zenoh_vision.errors import ParameterRefused, PayloadError
from zenoh_vision.image.turn import Size, Turn
from zenoh_vision.messages import Box, Track

if TYPE_CHECKING:  # load OpenCV, which `zv up` need not have to check a region
    from zenoh_vision.calibration.calibration import Calibration
    from zenoh_vision.image.picture import Picture


@dataclass(frozen=True, slots=True)
class Geometry:
    """The steps from a source's picture to a frame, in their order.

    Attributes:
        flip: ``none``, ``horizontal``, ``vertical`` or ``both``.
        box: The rectangle that is published, in pixels of the turned picture; None for all of it.
        rotate: 0, 90, 180 or 270 degrees clockwise, before it is flipped.
        turn: How the picture is turned by both.
    """

    flip: str = "none"
    box: Box | None = None
    rotate: int = 0
    turn: Turn = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        """Find how the picture is turned."""
        object.__setattr__(self, "turn", Turn.of(self.rotate, self.flip))

    @property
    def sideways(self) -> bool:
        """Whether left and right are exchanged."""
        return self.flip in ("horizontal", "both")

    @property
    def upside_down(self) -> bool:
        """Whether top and bottom are exchanged."""
        return self.flip in ("vertical", "both")

    def check(self, size: Size) -> None:
        """Check that the rectangle is within a source's pictures of a size.

        Raises:
            ParameterRefused: A part of it is outside.
        """
        if (box := self.box) is None:
            return
        width, height = self.turn.size(size)
        if box[0] + box[2] > width or box[1] + box[3] > height:
            raise ParameterRefused(
                f"region = {','.join(map(str, box))} is not within the picture of {width}x{height}",
                f"X + WIDTH at most {width}, Y + HEIGHT at most {height}",
            )

    def picture(self, picture: Picture, encoding: str) -> Picture:
        """Return the picture of the frame, in an encoding; the source's own if nothing changes.

        Raises:
            PayloadError: ``region_outside``, ``corrupt``.
        """
        if self.box is not None:  # cut out first, so that less must be converted
            try:
                self.check(picture.size)
            except ParameterRefused as refused:  # since it was set, the source changed its size
                raise PayloadError("region_outside", refused.error) from None
            picture = picture.cropped(self._of_source(self.box, picture.size))
        return picture.turned(self.flip, encoding, self.rotate)

    def tracks(self, tracks: Iterable[Track], size: Size) -> tuple[Track, ...]:
        """Return what is seen in the frame of objects in a source's picture of a size.

        If the edge of the rectangle cuts an object, its area is estimated by the share of its box
        that is inside.
        """
        if self == WHOLE:
            return tuple(tracks)
        found = (self._track(track, size) for track in tracks)
        return tuple(track for track in found if track is not None)

    def calibration(self, calibration: Calibration, size: Size) -> Calibration:
        """Return the calibration of the frames.

        The source's pictures have this size; the given calibration is theirs in any size.

        Raises:
            CalibrationFault: They have another ratio of width to height than the calibration.
        """
        seen = calibration.scaled(*size).rotated(self.rotate)
        seen = seen.mirrored(sideways=self.sideways, upside_down=self.upside_down)
        return seen if self.box is None else seen.cropped(*self.box)

    def _of_source(self, box: Box, size: Size) -> Box:
        """Return where a rectangle of the turned picture is in the source's, which has a size."""
        return self.turn.inverse.box(box, self.turn.size(size))

    def _track(self, track: Track, size: Size) -> Track | None:
        x, y, width, height = self.turn.box(track.box, size)
        left, top, *limits = self.box or (0, 0, *self.turn.size(size))
        vx, vy = self.turn.vector(track.vx, track.vy)
        right, bottom = min(limits[0], x + width - left), min(limits[1], y + height - top)
        left, top = max(0, x - left), max(0, y - top)
        wide, high = right - left, bottom - top
        if wide <= 0 or high <= 0:
            return None
        # The centre is rounded from the box's left and top, so it is not simply mirrored.
        return track.model_copy(
            update={
                "box": (left, top, wide, high),
                "x": float(left + int(wide / 2)),
                "y": float(top + int(high / 2)),
                "area": track.area * wide * high / (width * height),
                "vx": vx,
                "vy": vy,
            }
        )


WHOLE: Final = Geometry()
"""The source's picture as it is."""
