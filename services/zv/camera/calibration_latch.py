"""The calibration of the pictures as they are published: another one for each size and flip."""

from __future__ import annotations

from zenoh_vision.calibration.calibration import Calibration
from zenoh_vision.messages import CameraInfo, Header


class CalibrationLatch:
    """Knows of which pictures the calibration was told, and makes the message for others.

    Args:
        calibration: Of a picture of its size and in the flip of the start.
        flip: Of the start: ``none``, ``horizontal``, ``vertical`` or ``both``.
    """

    def __init__(self, calibration: Calibration, flip: str) -> None:
        self._calibration = calibration
        self._flip = flip
        self._told: tuple[int, int, int, str] | None = None

    def follow(self, header: Header, flip: str) -> CameraInfo | None:
        """Return the message before the first picture of an epoch, a size or a flip; else None.

        The calibration is scaled to the size of the picture, and mirrored if the flip has changed
        since the start.

        Raises:
            CalibrationFault: The picture has another shape than the calibration's. Raised once;
                for the next picture of this kind it returns None.
        """
        kind = (header.epoch, header.width, header.height, flip)
        if kind == self._told:
            return None
        self._told = kind
        scaled = self._calibration.scaled(header.width, header.height)
        seen = scaled.mirrored(
            sideways=_sideways(flip) != _sideways(self._flip),
            upside_down=_upside_down(flip) != _upside_down(self._flip),
        )
        return seen.message(header)


def _sideways(flip: str) -> bool:
    return flip in ("horizontal", "both")


def _upside_down(flip: str) -> bool:
    return flip in ("vertical", "both")
