"""A camera at this machine: USB, built in, or on a capture card."""

from __future__ import annotations

import logging
import os
import sys
import time
from collections.abc import Callable
from typing import Any, Final, Protocol

import cv2
import numpy as np
from numpy.typing import NDArray

from common import video_devices
from common.errors import SourceError, SourceLost
from services.camera.sources.base import Picture
from services.camera.sources.closing import Closing
from services.camera.sources.mjpeg import START_OF_IMAGE, DamagedJpeg, whole_jpeg

log = logging.getLogger(__name__)

MAX_DAMAGED: Final = 30
"""So many damaged packets in a row are not a hiccup on the bus any more: 1 s at 30 Hz."""

MAX_AGE_S: Final = 1.0
"""A driver's time stamp that is older was made by another clock."""

PACKET_FORMATS: Final = ("MJPG", "JPEG")
CONVERT: Final = cv2.CAP_PROP_CONVERT_RGB
ENCODINGS: Final = {(1, 1): "mono8", (1, 2): "mono16", (3, 1): "bgr8", (4, 1): "bgra8"}
"""By channels and bytes per channel."""


class VideoCapture(Protocol):
    """What is used of ``cv2.VideoCapture``."""

    def isOpened(self) -> bool: ...  # noqa: N802, D102 - OpenCV's names

    def set(self, property_id: int, value: float) -> bool: ...  # noqa: D102

    def get(self, property_id: int) -> float: ...  # noqa: D102

    def read(self) -> tuple[bool, Any]: ...  # noqa: D102

    def release(self) -> None: ...  # noqa: D102


def open_capture(device: str | int) -> VideoCapture:
    """Open a device through OpenCV, with Video4Linux where there is such.

    Raises:
        SourceError: There is no such device, or no permission; OpenCV would also say so itself,
            each time that a camera is looked for again.
    """
    if sys.platform != "linux":
        return cv2.VideoCapture(device)
    path = f"/dev/video{device}" if isinstance(device, int) else device
    if not os.access(path, os.R_OK | os.W_OK):
        raise SourceError(f"{path}: {video_devices.why_not(path)}")
    return cv2.VideoCapture(device, cv2.CAP_V4L2)


class DeviceSource:
    """Pictures of a camera at this machine.

    A device that delivers MJPG is asked for its packets as they are, which then need neither
    decoding nor encoding. What width, height, rate and FOURCC it granted is for the device to
    decide, and stands in ``description``.

    Args:
        device: Its number or path: ``0``, ``/dev/video0``.
        width: Wanted, pixels; None for the device's choice.
        height: Wanted, pixels.
        rate_hz: Wanted.
        fourcc: Wanted pixel format, ``MJPG`` or ``YUYV``; None for the device's choice.
        capture: Opens the device; tests put a stand-in here.

    Raises:
        SourceError: It cannot be opened or gives no picture; says which devices there are and
            what can be done.
    """

    live = True

    def __init__(
        self,
        device: str | int,
        *,
        width: int | None = None,
        height: int | None = None,
        rate_hz: float | None = None,
        fourcc: str | None = None,
        capture: Callable[[str | int], VideoCapture] = open_capture,
    ) -> None:
        number = int(device) if str(device).isdecimal() else None
        self._name = str(device) if number is None else f"/dev/video{number}"
        if fourcc is not None and len(fourcc) != 4:
            raise SourceError(f"{self._name}: a FOURCC has 4 characters, {fourcc!r} has not")
        self._capture = _opened(self._name, str(device) if number is None else number, capture)
        self._closing = Closing(self._capture.release)
        self._ask(width, height, rate_hz, fourcc)
        granted = _fourcc_text(self._capture.get(cv2.CAP_PROP_FOURCC))
        # 0 hands the packets over as they come.
        self._packets = granted in PACKET_FORMATS and self._capture.set(CONVERT, 0)
        try:
            self._first: Picture | None = self._next()
        except SourceLost as error:
            self.close()
            raise SourceError(f"{error}: it may be busy with another program") from None
        rate = self._capture.get(cv2.CAP_PROP_FPS)
        self.rate_hz: float | None = rate if rate > 0 else None
        details = [f"{self._first.width}x{self._first.height}"]
        details += [f"{rate:.4g} Hz"] if rate > 0 else []
        details += [granted] if granted else []
        self.description = f"device {self._name} ({', '.join(details)})"

    def read(self) -> Picture:
        """Return the next picture, as soon as the device has one.

        Raises:
            SourceLost: The device delivers no more, or nothing usable.
        """
        with self._closing.using():
            picture, self._first = self._first, None
            return picture or self._next()

    def close(self) -> None:
        """Give the device back, once a running ``read`` has returned; safe to call twice."""
        self._closing.close()

    def _ask(
        self, width: int | None, height: int | None, rate_hz: float | None, fourcc: str | None
    ) -> None:
        """Ask for what was wanted; the format first, since sizes and rates depend on it."""
        if fourcc:
            self._capture.set(cv2.CAP_PROP_FOURCC, cv2.VideoWriter.fourcc(*fourcc))
        wanted = {
            cv2.CAP_PROP_FRAME_WIDTH: width,
            cv2.CAP_PROP_FRAME_HEIGHT: height,
            cv2.CAP_PROP_FPS: rate_hz,
        }
        for property_id, value in wanted.items():
            if value:
                self._capture.set(property_id, value)

    def _next(self) -> Picture:
        for _ in range(MAX_DAMAGED):
            if self._closing.closed:
                raise SourceLost(f"{self._name}: closed")
            taken, image = self._capture.read()
            if not taken or image is None or not image.size:
                raise SourceLost(f"{self._name}: the device gives no picture")
            picture = self._picture(image)
            if picture is not None:
                return picture
        raise SourceLost(f"{self._name}: {MAX_DAMAGED} damaged pictures in a row")

    def _picture(self, image: NDArray[np.uint8]) -> Picture | None:
        """Return what the device gave as a picture; None if it is damaged."""
        if self._packets and 1 in image.shape[:2]:
            packet = image.tobytes()
            try:
                jpeg = whole_jpeg(packet)
            except DamagedJpeg as error:
                log.debug("%s: a damaged picture was left out: %s", self._name, error)
                if not packet.lstrip(b"\0").startswith(START_OF_IMAGE):
                    self._have_it_decoded("gives no JPEG, though it says so")
                return None
            if jpeg is None:
                self._have_it_decoded("gives JPEG of an unusual kind")
                return None
            return Picture(
                jpeg.encoding, jpeg.width, jpeg.height, jpeg=jpeg.data, stamp_ns=self._stamp_ns()
            )
        channels = 1 if image.ndim == 2 else image.shape[2]
        encoding = ENCODINGS.get((channels, image.dtype.itemsize))
        if encoding is None:
            raise SourceLost(f"{self._name}: {channels} channels of {image.dtype} are not known")
        pixels = image[:, :, 0] if image.ndim == 3 and channels == 1 else image
        height, width = pixels.shape[:2]
        return Picture(encoding, width, height, pixels=pixels, stamp_ns=self._stamp_ns())

    def _have_it_decoded(self, reason: str) -> None:
        log.warning("%s: %s; its pictures are decoded", self._name, reason)
        self._packets = False
        if not self._capture.set(CONVERT, 1):
            raise SourceLost(f"{self._name}: {reason}")

    def _stamp_ns(self) -> int | None:
        """Return when the driver filled the buffer, if its clock is the monotonic one."""
        age_s = time.monotonic() - self._capture.get(cv2.CAP_PROP_POS_MSEC) / 1e3
        return time.time_ns() - round(age_s * 1e9) if 0.0 <= age_s < MAX_AGE_S else None


def _opened(
    name: str, device: str | int, capture: Callable[[str | int], VideoCapture]
) -> VideoCapture:
    opened = capture(device)
    if not opened.isOpened():
        opened.release()
        raise SourceError(f"{name}: {video_devices.why_not(name)}")
    return opened


def _fourcc_text(code: float) -> str:
    text = int(code).to_bytes(4, "little", signed=True).decode("latin-1") if code > 0 else ""
    return text.strip() if text.isprintable() else ""
