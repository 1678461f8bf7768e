"""Calls of a Video4Linux driver, with the structures of linux/videodev2.h."""

from __future__ import annotations

import ctypes
import errno
import fcntl
import os
import threading
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Final, TypeVar

from videodev2 import videodev2 as v4l2

S = TypeVar("S", bound="ctypes.Structure | ctypes.c_int")

END_OF_LIST: Final = (errno.EINVAL, errno.ENOTTY, errno.ENODATA, errno.EPIPE)
"""What drivers answer behind the last item of a list, or if they have no such list."""

MOST_LISTED: Final = 256
"""Items of a list after which a driver is not asked for more, since its list has no end."""


class FrameSize(ctypes.Structure):
    """``v4l2_frmsizeenum``, which videodev2 0.0.4 lacks."""

    class _Sizes(ctypes.Union):
        _fields_ = (
            ("discrete", v4l2.v4l2_frmsize_discrete),
            ("stepwise", v4l2.v4l2_frmsize_stepwise),
        )

    _anonymous_ = ("sizes",)
    _fields_ = (
        ("index", ctypes.c_uint32),
        ("pixel_format", ctypes.c_uint32),
        ("type", ctypes.c_uint32),
        ("sizes", _Sizes),
        ("reserved", ctypes.c_uint32 * 2),
    )


class FrameInterval(ctypes.Structure):
    """``v4l2_frmivalenum``, which videodev2 0.0.4 lacks."""

    class _Intervals(ctypes.Union):
        _fields_ = (("discrete", v4l2.v4l2_fract), ("stepwise", v4l2.v4l2_frmival_stepwise))

    _anonymous_ = ("intervals",)
    _fields_ = (
        ("index", ctypes.c_uint32),
        ("pixel_format", ctypes.c_uint32),
        ("width", ctypes.c_uint32),
        ("height", ctypes.c_uint32),
        ("type", ctypes.c_uint32),
        ("intervals", _Intervals),
        ("reserved", ctypes.c_uint32 * 2),
    )


ENUM_FRAMESIZES: Final = v4l2._IOWR("V", 74, FrameSize)
ENUM_FRAMEINTERVALS: Final = v4l2._IOWR("V", 75, FrameInterval)

CAPTURE: Final = int(v4l2.V4L2_BUF_TYPE_VIDEO_CAPTURE)
CAPTURE_PLANES: Final = int(v4l2.V4L2_BUF_TYPE_VIDEO_CAPTURE_MPLANE)
DISCRETE: Final = 1
"""Of the types of sizes and intervals; the others are ranges."""


@dataclass(frozen=True, slots=True)
class Granted:
    """The format that a driver has set.

    Attributes:
        fourcc: Four characters, padded with spaces.
        width: Pixels.
        height: Pixels.
        stride: Bytes from one row to the next; of the first plane, if there are several.
        is_bt709: Whether its colours are those of BT.709, instead of BT.601.
        is_full_range: Whether black is 0 and white 255, instead of 16 and 235.
    """

    fourcc: str
    width: int
    height: int
    stride: int
    is_bt709: bool
    is_full_range: bool


class Driver:
    """An open device; its calls are safe between threads.

    Raises:
        OSError: It cannot be opened, or is no Video4Linux device.
    """

    def __init__(self, path: str) -> None:
        self._lock = threading.Lock()
        self.fd = os.open(path, os.O_RDWR | os.O_NONBLOCK | os.O_CLOEXEC)
        try:
            found = self.call(v4l2.VIDIOC_QUERYCAP, v4l2.v4l2_capability())
        except OSError:
            self.close()
            raise
        has_own = found.capabilities & v4l2.V4L2_CAP_DEVICE_CAPS
        self._capabilities = int(found.device_caps if has_own else found.capabilities)
        self.name = text_of(found.card)
        self.driver = text_of(found.driver)
        self.bus = text_of(found.bus_info)
        self.type = CAPTURE if self._has(v4l2.V4L2_CAP_VIDEO_CAPTURE) else CAPTURE_PLANES

    @property
    def captures(self) -> bool:
        """Whether it delivers pictures, in buffers that can be mapped."""
        either = v4l2.V4L2_CAP_VIDEO_CAPTURE | v4l2.V4L2_CAP_VIDEO_CAPTURE_MPLANE
        return self._has(either) and self._has(v4l2.V4L2_CAP_STREAMING)

    def _has(self, capability: int) -> bool:
        return bool(self._capabilities & capability)

    def call(self, request: int, argument: S) -> S:
        """Make a call, and return its argument, which the driver has filled in.

        Raises:
            OSError: As the driver answers; ENODEV once it is closed.
        """
        # The lock keeps another thread from calling while the number of the file is given to
        # another one. No call here waits for pictures.
        with self._lock:
            if self.fd < 0:
                raise OSError(errno.ENODEV, os.strerror(errno.ENODEV))
            while True:
                try:
                    fcntl.ioctl(self.fd, request & 0xFFFFFFFF, argument)
                except InterruptedError:
                    continue
                return argument

    def listed(self, request: int, argument: S) -> Iterator[S]:
        """Yield the items of a list, each in the same structure, whose ``index`` it counts."""
        item: Any = argument
        for index in range(MOST_LISTED):
            item.index = index
            try:
                self.call(request, argument)
            except OSError as error:
                if error.errno in END_OF_LIST:
                    return
                raise
            yield argument

    def close(self) -> None:
        """Close the device; safe to call twice."""
        with self._lock:
            if self.fd >= 0:
                os.close(self.fd)
                self.fd = -1

    # Formats

    def set_format(self, fourcc: str, width: int, height: int) -> Granted:
        """Set a format, and return the one that the driver made of it."""
        wanted = v4l2.v4l2_format()
        wanted.type = self.type
        part = wanted.fmt.pix if self.type == CAPTURE else wanted.fmt.pix_mp
        part.pixelformat, part.width, part.height = code_of(fourcc), width, height
        part.field = v4l2.V4L2_FIELD_ANY
        return self._granted(self.call(v4l2.VIDIOC_S_FMT, wanted))

    def _granted(self, found: Any) -> Granted:
        part = found.fmt.pix if self.type == CAPTURE else found.fmt.pix_mp
        plane = part if self.type == CAPTURE else part.plane_fmt[0]
        encoding = part.ycbcr_enc
        by_space = part.colorspace in (v4l2.V4L2_COLORSPACE_REC709, v4l2.V4L2_COLORSPACE_DCI_P3)
        is_jpeg = part.colorspace == v4l2.V4L2_COLORSPACE_JPEG
        stated = part.quantization
        return Granted(
            fourcc=fourcc_of(part.pixelformat),
            width=int(part.width),
            height=int(part.height),
            stride=int(plane.bytesperline),
            is_bt709=bool(encoding == v4l2.V4L2_YCBCR_ENC_709 if encoding else by_space),
            is_full_range=bool(stated == v4l2.V4L2_QUANTIZATION_FULL_RANGE if stated else is_jpeg),
        )

    def rate_hz(self) -> float | None:
        """Return the rate that is set; None if the driver does not say."""
        found = v4l2.v4l2_streamparm()
        found.type = self.type
        try:
            self.call(v4l2.VIDIOC_G_PARM, found)
        except OSError:
            return None
        return rate_of(found.parm.capture.timeperframe)

    def set_rate(self, rate_hz: float) -> float | None:
        """Set a rate, and return the one that the driver made of it; None if it does not say."""
        wanted = v4l2.v4l2_streamparm()
        wanted.type = self.type
        part = wanted.parm.capture
        part.timeperframe.numerator, part.timeperframe.denominator = 1000, round(rate_hz * 1000)
        try:
            self.call(v4l2.VIDIOC_S_PARM, wanted)
        except OSError:
            return self.rate_hz()
        return rate_of(part.timeperframe)

    def input_fault(self) -> str:
        """Return what the driver says is wrong with its input; empty if nothing is.

        Grabbers know whether there is a signal.
        """
        number, found = ctypes.c_int(), v4l2.v4l2_input()
        try:
            found.index = self.call(v4l2.VIDIOC_G_INPUT, number).value
            self.call(v4l2.VIDIOC_ENUMINPUT, found)
        except OSError:
            return ""
        faults = {
            v4l2.V4L2_IN_ST_NO_POWER: "no power",
            v4l2.V4L2_IN_ST_NO_SIGNAL: "no signal",
            v4l2.V4L2_IN_ST_NO_SYNC: "no sync lock",
        }
        return ", ".join(words for flag, words in faults.items() if found.status & flag)


def fourcc_of(code: int) -> str:
    """Return the four characters of a pixel format; drivers set the highest bit for big endian."""
    text = (code & 0x7FFFFFFF).to_bytes(4, "little").decode("latin-1")
    return f"{text[:3]}{'B' if code >> 31 and text[3] == ' ' else text[3]}"


def code_of(fourcc: str) -> int:
    """Return the number of a pixel format."""
    if fourcc == "Y16B":
        return int(v4l2.V4L2_PIX_FMT_Y16_BE) & 0xFFFFFFFF
    return int.from_bytes(fourcc.ljust(4).encode("latin-1"), "little")


def text_of(field: Any) -> str:
    """Return the text in a field of characters, which ends at the first zero."""
    return bytes(field).partition(b"\0")[0].decode("utf-8", "replace").strip()


def rate_of(interval: Any) -> float | None:
    """Return the rate of an interval between pictures; None for one of 0."""
    return interval.denominator / interval.numerator if interval.numerator else None
