"""A local camera: USB, built in, or on a capture card, by Video4Linux."""

from __future__ import annotations

import errno
import logging
import os
import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from zenoh_vision.errors import PayloadError, SourceError, SourceLost
from zenoh_vision.host import video_devices
from zenoh_vision.image.picture import Picture
from zv.camera.sources.base import DeviceWish, TimedPicture
from zv.camera.sources.libav_frames import FrameConverter
from zv.camera.sources.mjpeg import DamagedJpeg, whole_jpeg

if TYPE_CHECKING or sys.platform == "linux":
    from zv.camera.sources.v4l2.buffers import Buffers, Filled
    from zv.camera.sources.v4l2.choice import Mode, choose
    from zv.camera.sources.v4l2.controls import Controls, Value
    from zv.camera.sources.v4l2.driver import Driver
    from zv.camera.sources.v4l2.layouts import JPEG, raw_picture
    from zv.camera.sources.v4l2.listing import holders
    from zv.camera.sources.v4l2.offers import CLOSE, offers_of, rates_of

log = logging.getLogger(__name__)

MAX_DAMAGED: Final = 30
"""Number of damaged pictures in a row after which the source is lost: 1 s at 30 Hz."""

LOOK_EVERY_S: Final = 0.1
"""How often a wait for a picture looks whether it is still wanted."""

MOST_LOST: Final = 10_000
"""A larger gap in the numbers of a driver's pictures is none: the driver began to count again."""


class DeviceSource:
    """Pictures of a local camera, which is named by its number or path.

    Format, size and rate are chosen by the rule of ``v4l2.choice``. JPEGs are passed on undecoded,
    so that they need neither decoding nor encoding; other formats are converted for who wants
    pixels. The time of capture is the driver's.

    Args:
        device: ``0``, ``/dev/video0``, or a stable path below ``/dev/v4l``.
        wish: What is asked of it.
        controls: Values for its controls, by name.
        timeout_s: Longest wait for a picture.
        still_wanted: Called often during a wait; raises ``SourceLost`` to end it.

    Raises:
        SourceError: It cannot be opened, or does not offer what is asked; the text says which
            devices there are, or what it offers, and has a remedy.
    """

    live = True

    def __init__(
        self,
        device: str | int,
        wish: DeviceWish | None = None,
        *,
        controls: Mapping[str, Value] | None = None,
        timeout_s: float = 5.0,
        still_wanted: Callable[[], object] = lambda: None,
    ) -> None:
        number = int(device) if str(device).isdecimal() else None
        self._name = str(device) if number is None else f"/dev/video{number}"
        if sys.platform != "linux":
            raise SourceError(
                f"{self._name}: devices are read by Video4Linux, which only Linux has; "
                "on other systems a program can be the source: command:ffmpeg ..."
            )
        self._timeout_s, self._still_wanted = timeout_s, still_wanted
        self._converter = FrameConverter()
        self._decoder: Any = None
        self._last_sequence: int | None = None
        self._first: TimedPicture | None = None
        self._stamped = ""
        self._driver = self._opened()
        self._buffers: Buffers | None = None
        try:
            self._start(wish or DeviceWish(), controls or {})
        except BaseException:
            self.close()
            raise

    def read(self) -> TimedPicture:
        """Return the newest picture, as soon as the device has one that was not read.

        Raises:
            SourceLost: The device is gone, stopped delivering, or delivers nothing usable.
        """
        picture, self._first = self._first, None
        return picture or self._next()

    def check(self, wish: DeviceWish) -> None:
        """Refuse what the device does not offer.

        Raises:
            SourceError: The text has the wish and what is offered.
        """
        try:
            choose(self._offers, wish, lambda *which: rates_of(self._driver, *which))
        except OSError as error:
            raise self._failure(error) from None

    def close(self) -> None:
        """Release the device; safe to call twice."""
        if self._buffers is not None:
            self._buffers.close()
        self._driver.close()

    # Opening

    def _opened(self) -> Driver:
        reason = video_devices.why_not(self._name)
        if reason:
            raise SourceError(f"{self._name}: {reason}")
        try:
            driver = Driver(self._name)
        except OSError as error:
            if error.errno in (errno.ENOTTY, errno.EINVAL):
                raise SourceError(f"{self._name}: it is no Video4Linux device") from None
            raise self._failure(error) from None
        if not driver.captures:
            driver.close()
            others = [node for node in video_devices.device_nodes() if str(node) != self._name]
            there = ", ".join(map(video_devices.describe, others))
            more = f"; there are also: {there}" if there else ""
            raise SourceError(f"{self._name}: it delivers no pictures{more}")
        return driver

    def _failure(self, error: OSError) -> SourceError:
        if error.errno == errno.EBUSY:
            users = ", ".join(holders(Path(self._name)))
            by = f"by {users}" if users else "by another program"
            return SourceError(f"{self._name}: it is in use {by}; only one can read a device")
        if error.errno in (errno.ENOTTY, errno.EINVAL):
            why = error.strerror or str(error)
            return SourceError(f"{self._name}: the driver refuses a call that is needed ({why})")
        return SourceError(f"{self._name}: {error.strerror or error}")

    def _start(self, wish: DeviceWish, controls: Mapping[str, Value]) -> None:
        driver = self._driver
        try:
            self._offers = offers_of(driver)
            mode = choose(self._offers, wish, lambda *which: rates_of(driver, *which))
            self._form = driver.set_format(mode.fourcc, mode.width, mode.height)
            rate = driver.rate_hz() if mode.rate_hz is None else driver.set_rate(mode.rate_hz)
            self.controls = Controls(driver)
            for sentence in self.controls.apply(controls):
                log.warning("%s: %s", self._name, sentence)
            self._buffers = Buffers(driver)
        except OSError as error:
            raise self._failure(error) from None
        except SourceError as error:
            raise SourceError(f"{self._name}: {error}") from None
        form = self._form
        granted = Mode(form.fourcc, form.width, form.height, rate)
        self._tell_difference(mode, wish, granted)
        self.rate_hz: float | None = rate
        fault = driver.input_fault()
        if fault:
            log.warning("%s: the driver says: %s", self._name, fault)
        try:
            self._first = self._next()
        except SourceLost as error:
            raise SourceError(str(error)) from None
        stamps = f", stamps of {self._stamped}" if self._stamped else ", no stamps"
        self.description = f"device {self._name} ({driver.name}: {granted}{stamps})"

    def _tell_difference(self, mode: Mode, wish: DeviceWish, granted: Mode) -> None:
        """Say, or refuse, what the driver has made of a mode that it offers."""
        asked = {"fourcc": wish.fourcc, "width": wish.width, "height": wish.height}
        for name, wanted in asked.items():
            got = getattr(granted, name)
            if wanted is not None and str(got).strip() != str(wanted).strip():
                raise SourceError(
                    f"{self._name}: {name} {wanted} is not possible; the driver made it {got}"
                )
        if (mode.fourcc, mode.width, mode.height) != (
            granted.fourcc,
            granted.width,
            granted.height,
        ):
            log.warning("%s: asked for %s; the driver made it %s", self._name, mode, granted)
        enough = wish.rate_hz or mode.rate_hz
        if enough and granted.rate_hz is not None and granted.rate_hz < CLOSE * enough:
            log.warning(
                "%s: asked for %.4g Hz; the driver made it %.4g Hz",
                self._name,
                enough,
                granted.rate_hz,
            )

    # Reading

    def _next(self) -> TimedPicture:
        lost = 0
        for _ in range(MAX_DAMAGED):
            filled = self._filled()
            lost += self._passed_over(filled.sequence)
            picture = self._picture(filled)
            if picture is not None:
                self._stamped = ""
                if filled.stamp_ns is not None:
                    self._stamped = "exposure start" if filled.at_start else "picture end"
                return TimedPicture(picture, stamp_ns=filled.stamp_ns, lost=lost)
            lost += 1
        raise SourceLost(f"{self._name}: {MAX_DAMAGED} damaged pictures in a row")

    def _filled(self) -> Filled:
        """Return the next buffer that the driver has filled."""
        assert self._buffers is not None
        waited_s = 0.0
        while True:
            try:
                is_filled, has_event = self._buffers.wait(LOOK_EVERY_S)
                if has_event:
                    self.controls.take_events()
                if is_filled:
                    return self._buffers.take()
            except BlockingIOError:
                pass
            except OSError as error:
                gone = error.errno in (errno.ENODEV, errno.ENXIO, errno.EIO, errno.EINVAL)
                words = "the device is gone" if gone else error.strerror or str(error)
                raise SourceLost(f"{self._name}: {words}") from None
            self._still_wanted()
            waited_s += LOOK_EVERY_S
            if waited_s >= self._timeout_s:
                fault = self._driver.input_fault()
                why = f" (the driver says: {fault})" if fault else ""
                raise SourceLost(f"{self._name}: no picture for {self._timeout_s:g} s{why}")

    def _passed_over(self, sequence: int) -> int:
        """Return how many pictures the driver made before this one that were not read."""
        last, self._last_sequence = self._last_sequence, sequence
        gap = 0 if last is None else sequence - last - 1
        return gap if 0 < gap < MOST_LOST else 0

    def _picture(self, filled: Filled) -> Picture | None:
        """Return a buffer as a picture; None if it is damaged."""
        if filled.damaged and self._form.fourcc not in JPEG:
            log.debug("%s: the driver says that data are missing", self._name)
            return None
        try:
            if self._form.fourcc in JPEG:
                return self._jpeg(filled.data.tobytes())
            return raw_picture(filled.data, self._form, self._converter)
        except (PayloadError, DamagedJpeg) as error:
            log.debug("%s: a damaged picture was skipped: %s", self._name, error)
            return None

    def _jpeg(self, packet: bytes) -> Picture | None:
        jpeg = whole_jpeg(packet) if self._decoder is None else None
        if jpeg is not None:
            return jpeg
        if self._decoder is None:
            from av import CodecContext

            log.warning("%s: delivers JPEG of an unusual kind; it is decoded", self._name)
            self._decoder = CodecContext.create("mjpeg", "r")
        return self._decoded(packet)

    def _decoded(self, packet: bytes) -> Picture | None:
        from av import FFmpegError, Packet

        try:
            frames = self._decoder.decode(Packet(packet))
        except FFmpegError as error:
            raise DamagedJpeg(str(error)) from None
        return self._converter.picture(frames[-1]) if frames else None


def stable_name(device: str | int) -> str | None:
    """Return the path of a device that stays the same when it is plugged in again; None if none."""
    path = f"/dev/video{device}" if str(device).isdecimal() else str(device)
    if path.startswith("/dev/v4l/"):
        return path
    return next(iter(video_devices.stable_paths(Path(path))), None)


def found_again(device: str, before: str | None) -> str:
    """Return where a device is that was open before.

    Args:
        device: As the user names it.
        before: Its ``stable_name`` when it was open; None if it was not, or had none.

    Raises:
        SourceError: Another device has its number now, and its own is not there.
    """
    if before is None or before == device:
        return device
    if os.path.exists(before):
        return before
    now = stable_name(device)
    if now is not None and before.startswith("/dev/v4l/by-id/"):
        raise SourceError(f"{device}: it is another device now ({now}); {before} is not there")
    return device
