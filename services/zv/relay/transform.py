"""Chooses frames, and rectifies, crops and reduces pictures, their calibrations alike."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, cast

import cv2
import numpy as np

from zenoh_vision.calibration.calibration import IDENTITY, Calibration
from zenoh_vision.calibration.camera_model import CameraModel
from zenoh_vision.calibration.plane import Plane
from zenoh_vision.errors import ParameterRefused
from zenoh_vision.image.frame import Frame
from zenoh_vision.image.picture import Picture, PixelPicture
from zenoh_vision.image.pixel_formats import Pixels
from zenoh_vision.messages import Box, Header


@dataclass(frozen=True, slots=True)
class Transform:
    """What becomes of each picture, in this order.

    Attributes:
        calibration: Of the lens whose distortion is taken out; None to leave it.
        box: The part of the picture that stays, x, y, width, height; None for all of it.
        scale: Factor of width and height, 0 to 1.
    """

    calibration: Calibration | None = None
    box: Box | None = None
    scale: float = 1.0

    @property
    def moves_pixels(self) -> bool:
        """Whether coordinates in the result are others than in the frame."""
        return self.calibration is not None or self.box is not None


class Transformer:
    """Applies transforms; keeps the maps of a rectification, which take longer than its use."""

    def __init__(self) -> None:
        self._maps: tuple[Calibration, Any, Any] | None = None

    def apply(self, frame: Frame, transform: Transform) -> tuple[Picture, tuple[int, int]]:
        """Return a frame's picture transformed, and its width and height before it was scaled.

        Raises:
            ParameterRefused: The box is not within the picture.
            PayloadError: ``corrupt``, if the picture cannot be decoded.
        """
        picture, size = frame.picture, (frame.header.width, frame.header.height)
        if transform.moves_pixels:
            pixels = frame.pixels
            if transform.calibration is not None:
                pixels = self.rectified(pixels, transform.calibration)
            if transform.box is not None:
                pixels = _cropped(pixels, transform.box)
            picture = PixelPicture(pixels, picture.encoding)
            size = picture.size
        wanted = tuple(max(1, round(side * transform.scale)) for side in size)
        if wanted[0] < picture.size[0] and wanted[1] < picture.size[1]:
            picture = picture.scaled(*wanted)
        return picture, size

    def rectified(self, pixels: Pixels, calibration: Calibration) -> Pixels:
        """Return pixels as a lens without distortion shows them; black where it saw nothing.

        Args:
            pixels: (height, width[, channels]) of the size of the calibration.
            calibration: Its ``p`` says which part the result shows, as ROS' image_proc does.
        """
        # Compared by value: a calibration of another size is scaled for each frame.
        if self._maps is None or self._maps[0] != calibration:
            self._maps = (calibration, *_maps(calibration))
        # Depths of both sides of an edge have no mean.
        how = cv2.INTER_NEAREST if pixels.dtype != np.uint8 else cv2.INTER_LINEAR
        return cast("Pixels", cv2.remap(pixels, self._maps[1], self._maps[2], how))


def _maps(calibration: Calibration) -> tuple[Any, Any]:
    """Return where in the picture each pixel of the rectified one is, in OpenCV's form."""
    lens = calibration.camera
    matrix, distortion = lens.matrix, np.array(lens.d, np.float64)
    rotation = np.reshape(calibration.r, (3, 3))
    projection = np.reshape(calibration.p, (3, 4))[:, :3]
    size = (lens.width, lens.height)
    if lens.distortion_model == "equidistant":
        return cv2.fisheye.initUndistortRectifyMap(
            matrix, distortion, rotation, projection, size, cv2.CV_16SC2
        )
    return cv2.initUndistortRectifyMap(matrix, distortion, rotation, projection, size, cv2.CV_16SC2)


def _cropped(pixels: Pixels, box: Box) -> Pixels:
    x, y, width, height = box
    if y + height > pixels.shape[0] or x + width > pixels.shape[1]:
        raise ParameterRefused(
            f"the region {x},{y},{width},{height} is not within the picture of "
            f"{pixels.shape[1]}x{pixels.shape[0]}",
            "a part of it",
        )
    return pixels[y : y + height, x : x + width].copy()


def calibration_after(calibration: Calibration, transform: Transform) -> Calibration:
    """Return the calibration of the transformed pictures; scaling moves no coordinates."""
    found = calibration
    if transform.calibration is not None:
        found = _without_distortion(calibration)
    if transform.box is not None:
        found = found.cropped(*transform.box)
    return found


def _without_distortion(calibration: Calibration) -> Calibration:
    """Return the calibration of rectified pictures: ``p`` alone says what they show."""
    projection = np.reshape(calibration.p, (3, 4))[:, :3]
    k = tuple(map(float, projection.ravel()))
    lens = calibration.camera
    plane = calibration.plane
    if plane is not None:
        # From the pixels of the lens without distortion to those of the rectified picture.
        rotation = np.reshape(calibration.r, (3, 3))
        move = projection @ rotation @ np.linalg.inv(lens.matrix)
        plane = Plane(tuple(map(float, (plane.matrix @ np.linalg.inv(move)).ravel())))
    return replace(
        calibration, camera=CameraModel(lens.width, lens.height, k), r=IDENTITY, plane=plane
    )


class RateLimit:
    """Lets frames pass by their stamps, which are even where their arrival is not.

    The time of the next one advances by whole periods, so that a limit of 20 Hz lets two of three
    frames of 30 Hz pass, and not every second one.
    """

    def __init__(self) -> None:
        self._epoch: int | None = None
        self._next_ns = 0
        self._last_ns = 0

    def allow(self, header: Header, rate_hz: float | None) -> bool:
        """Tell whether a frame passes; ``rate_hz`` None lets all pass."""
        stamp_ns = header.stamp_ns
        if rate_hz is None:
            self._epoch = None
            return True
        period_ns = int(1e9 / rate_hz)
        is_new = header.epoch != self._epoch or stamp_ns < self._last_ns
        self._epoch, self._last_ns = header.epoch, stamp_ns
        if is_new or stamp_ns >= self._next_ns + period_ns or self._next_ns - stamp_ns > period_ns:
            self._next_ns = stamp_ns + period_ns  # the first frame, after a pause, or a new rate
            return True
        if stamp_ns + period_ns // 100 < self._next_ns:  # stamps vary by less than that
            return False
        self._next_ns += period_ns
        return True
