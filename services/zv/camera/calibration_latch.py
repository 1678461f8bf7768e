"""The calibration of the frames as published: one for each size, orientation and region."""

from __future__ import annotations

from zenoh_vision.calibration.calibration import Calibration
from zenoh_vision.calibration.camera_model import CalibrationFault
from zenoh_vision.image.turn import Size
from zenoh_vision.messages import CameraInfo, Header
from zv.camera.geometry import Geometry


def without_encoding(header: Header) -> Header:
    """Return the header of a frame for what is no picture of it."""
    return header.model_copy(update={"encoding": None})


class CalibrationLatch:
    """Makes the calibration message to be sent when the geometry of the frames changes.

    The calibration is of frames that are rotated and flipped as at the start, without a region.
    """

    def __init__(self, calibration: Calibration, at_start: Geometry) -> None:
        self._of_source = calibration.mirrored(
            sideways=at_start.sideways, upside_down=at_start.upside_down
        ).rotated(-at_start.rotate % 360)
        self._published_for: tuple[object, ...] | None = None
        self._fault = ""  # the last picture's

    def follow(self, header: Header, geometry: Geometry, source: Size) -> CameraInfo | None:
        """Return the message before the first frame of an epoch, size or geometry; else None.

        ``source`` is the size of the source's picture, which the frame shows with the geometry.

        Raises:
            CalibrationFault: The picture has another ratio of width to height than the calibration.
                Raised once; for further pictures of that size it returns None.
        """
        kind = (header.epoch, source, geometry)
        if kind == self._published_for:
            return None
        self._published_for = kind
        try:
            calibration = geometry.calibration(self._of_source, source)
        except CalibrationFault as fault:
            if str(fault) == self._fault:  # as in each epoch of a video that is played again
                return None
            self._fault = str(fault)
            raise
        self._fault = ""
        return calibration.message(without_encoding(header))
