"""The calibration of the pictures as they are published: one for each size, flip and region."""

from __future__ import annotations

from zenoh_vision.calibration.calibration import Calibration
from zenoh_vision.messages import Box, CameraInfo, Header


class CalibrationLatch:
    """Makes the calibration message to be sent when size, flip or region of the pictures change.

    Args:
        calibration: Calibration of pictures of its own size, flipped as at the start.
        flip: The flip at the start: ``none``, ``horizontal``, ``vertical`` or ``both``.
    """

    def __init__(self, calibration: Calibration, flip: str) -> None:
        self._calibration = calibration
        self._flip = flip
        self._published_for: tuple[object, ...] | None = None

    def follow(
        self,
        header: Header,
        flip: str,
        whole: tuple[int, int] | None = None,
        box: Box | None = None,
    ) -> CameraInfo | None:
        """Return the message before the first picture of an epoch, size, flip or region; else None.

        The calibration is scaled to the size of the picture, and mirrored if the flip has changed
        since the start. For a region, its principal point and plane refer to the pixels of the
        region.

        Args:
            header: Header of the picture as it is published.
            flip: How the picture was flipped.
            whole: Width and height of the picture before a region was cut out of it.
            box: The region; None for all of the picture.

        Raises:
            CalibrationFault: The picture has another ratio of width to height than the calibration.
                Raised once; for the next picture of this kind it returns None.
        """
        published = header.width, header.height
        kind = (header.epoch, *published, flip, whole, box)
        if kind == self._published_for:
            return None
        self._published_for = kind
        scaled = self._calibration
        if box is None or whole is None:
            scaled = scaled.scaled(*published)
        else:
            scaled = scaled.scaled(*whole)
        seen = scaled.mirrored(
            sideways=_sideways(flip) != _sideways(self._flip),
            upside_down=_upside_down(flip) != _upside_down(self._flip),
        )
        if box is not None:
            seen = seen.cropped(*box).scaled(*published)
        return seen.message(header)


def _sideways(flip: str) -> bool:
    return flip in ("horizontal", "both")


def _upside_down(flip: str) -> bool:
    return flip in ("vertical", "both")
