"""A local camera: USB, built in, or on a capture card."""

from __future__ import annotations

import logging
import os
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any, Final

import cv2
from numpy.typing import NDArray

from zenoh_vision.errors import PayloadError, SourceError, SourceLost
from zenoh_vision.host import video_devices
from zenoh_vision.image.packed import PackedPicture, is_packed
from zv.camera.sources.base import Picture, picture_of
from zv.camera.sources.mjpeg import START_OF_IMAGE, DamagedJpeg, whole_jpeg

log = logging.getLogger(__name__)

MAX_DAMAGED: Final = 30
"""Number of damaged packets in a row after which the source is lost: 1 s at 30 Hz."""

MAX_AGE_S: Final = 1.0
"""A driver's time stamps are believed from the first one on that is not older than this. Later ones
may be: those of pictures that waited in the driver's buffers while this process was suspended."""

CONVERT: Final = cv2.CAP_PROP_CONVERT_RGB

UNDECODED: Final = {"MJPG": "MJPG", "JPEG": "MJPG", "YUYV": "YUYV", "YUY2": "YUYV"}
"""Formats that are read as the device delivers them, by the FOURCC that it grants."""


def open_capture(device: str | int) -> cv2.VideoCapture:
    """Open a device through OpenCV, on Linux with Video4Linux.

    Raises:
        SourceError: There is no such device, or no permission. This is checked first, since
            OpenCV would log it at each attempt.
    """
    if sys.platform != "linux":
        return cv2.VideoCapture(device)
    path = f"/dev/video{device}" if isinstance(device, int) else device
    if not os.access(path, os.R_OK | os.W_OK):
        raise SourceError(f"{path}: {video_devices.why_not(path)}")
    return cv2.VideoCapture(device, cv2.CAP_V4L2)


class DeviceSource:
    """Pictures of a local camera, which is named by its number or path.

    If the device delivers MJPG, its packets are read undecoded, so that they need neither decoding
    nor encoding. YUYV is read as it is too, so that it can be converted straight into the memory
    that is to hold the pixels. OpenCV decodes other formats. Width, height, rate and pixel format
    (FOURCC) are requests, None for the device's choice; ``description`` has the values that the
    device uses.

    Raises:
        SourceError: It cannot be opened or delivers no picture; the text lists the existing
            devices and has a remedy.
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
        capture: Callable[[str | int], cv2.VideoCapture] = open_capture,
    ) -> None:
        number = int(device) if str(device).isdecimal() else None
        self._name = str(device) if number is None else f"/dev/video{number}"
        self._capture = capture(str(device) if number is None else number)
        if not self._capture.isOpened():
            self._capture.release()
            raise SourceError(f"{self._name}: {video_devices.why_not(self._name)}")
        requests = {
            # The format first, since sizes and rates depend on it.
            cv2.CAP_PROP_FOURCC: cv2.VideoWriter.fourcc(*fourcc) if fourcc else None,
            cv2.CAP_PROP_FRAME_WIDTH: width,
            cv2.CAP_PROP_FRAME_HEIGHT: height,
            cv2.CAP_PROP_FPS: rate_hz,
        }
        for property_id, value in requests.items():
            if value:
                self._capture.set(property_id, value)
        granted = _fourcc_text(self._capture.get(cv2.CAP_PROP_FOURCC))
        self._undecoded = UNDECODED.get(granted)
        self._has_stamps = False
        if self._undecoded and not self._capture.set(CONVERT, 0):
            self._undecoded = None
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
            SourceLost: The device stopped delivering, or delivers nothing usable.
        """
        picture, self._first = self._first, None
        return picture or self._next()

    def close(self) -> None:
        """Release the device."""
        self._capture.release()

    def _next(self) -> Picture:
        for _ in range(MAX_DAMAGED):
            taken, image = self._capture.read()
            if not taken or image is None or not image.size:
                raise SourceLost(f"{self._name}: the device delivers no picture")
            picture = self._picture(image)
            if picture is not None:
                return picture
        raise SourceLost(f"{self._name}: {MAX_DAMAGED} damaged pictures in a row")

    def _picture(self, image: NDArray[Any]) -> Picture | None:
        """Return an image of the device as a picture; None if it is damaged."""
        if self._undecoded == "YUYV" and image.shape[2:] != (3,):  # some decode it nevertheless
            if is_packed(image):
                packed = PackedPicture(image)
                return Picture("bgr8", *packed.size, stored=packed, stamp_ns=self._stamp_ns())
            self._decode_from_now(f"delivers no YUYV, but {image.shape} {image.dtype}")
            return None
        if self._undecoded == "MJPG" and 1 in image.shape[:2]:
            packet = image.tobytes()
            try:
                jpeg = whole_jpeg(packet)
            except DamagedJpeg as error:
                log.debug("%s: a damaged picture was skipped: %s", self._name, error)
                if not packet.lstrip(b"\0").startswith(START_OF_IMAGE):
                    self._decode_from_now("delivers no JPEG although it claims to")
                return None
            if jpeg is None:
                self._decode_from_now("delivers JPEG of an unusual kind")
                return None
            return replace(jpeg, stamp_ns=self._stamp_ns())
        try:
            return picture_of(image, stamp_ns=self._stamp_ns())
        except PayloadError as error:
            raise SourceLost(f"{self._name}: {error.detail}") from None

    def _decode_from_now(self, reason: str) -> None:
        log.warning("%s: %s; its pictures are decoded", self._name, reason)
        self._undecoded = None
        if not self._capture.set(CONVERT, 1):
            raise SourceLost(f"{self._name}: {reason}")

    def _stamp_ns(self) -> int | None:
        """Return when the driver filled the buffer; None if its clock is not the monotonic one."""
        filled_s = self._capture.get(cv2.CAP_PROP_POS_MSEC) / 1e3
        age_s = time.monotonic() - filled_s
        if 0.0 <= age_s < MAX_AGE_S:
            self._has_stamps = True
        is_stamp = self._has_stamps and filled_s > 0 and age_s >= 0
        return time.time_ns() - round(age_s * 1e9) if is_stamp else None


def _fourcc_text(code: float) -> str:
    text = int(code).to_bytes(4, "little", signed=True).decode("latin-1") if code > 0 else ""
    return text.strip() if text.isprintable() else ""
