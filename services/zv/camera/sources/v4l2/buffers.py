"""Takes pictures out of a driver's buffers, the newest first of all, with the time of capture."""

from __future__ import annotations

import ctypes
import mmap
import select
import time
from contextlib import suppress
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from videodev2 import videodev2 as v4l2

from zv.camera.sources.v4l2.driver import CAPTURE, Driver

COUNT: Final = 4
"""Buffers: one that the driver fills, one that is read, two that cover a pause of this process."""

MAX_AGE_S: Final = 1.0
"""A driver's time stamps are believed from the first one on that is not older than this. Later ones
may be: those of pictures that waited in the driver's buffers while this process was suspended."""

MAX_AHEAD_S: Final = 0.1
"""Some drivers calculate the end of a picture from its start, and deliver it a little earlier."""


@dataclass(frozen=True, slots=True)
class Filled:
    """A buffer with a picture; valid until the next one is taken.

    Attributes:
        data: Its bytes, (n,) uint8.
        sequence: The driver's number of the picture, from 0.
        stamp_ns: Time of capture, ns since 1970; None if the driver's clock is not known.
        at_start: Whether that is the start of exposure, instead of the end of the picture.
        damaged: Whether the driver says that data are missing.
    """

    data: NDArray[np.uint8]
    sequence: int
    stamp_ns: int | None
    at_start: bool
    damaged: bool


class Buffers:
    """The buffers of an open device, whose format is set, while it delivers pictures.

    Raises:
        OSError: EBUSY: another program has its buffers; others as the driver answers.
    """

    def __init__(self, driver: Driver) -> None:
        self._driver = driver
        self._poll = select.poll()
        self._poll.register(driver.fd, select.POLLIN | select.POLLPRI)
        self._maps: list[mmap.mmap] = []
        self._taken: Any = None
        self._clock = Clock()
        wanted = v4l2.v4l2_requestbuffers()
        wanted.count, wanted.type, wanted.memory = COUNT, driver.type, v4l2.V4L2_MEMORY_MMAP
        driver.call(v4l2.VIDIOC_REQBUFS, wanted)
        try:
            for index in range(wanted.count):
                each = self._buffer(index)
                driver.call(v4l2.VIDIOC_QUERYBUF, each)
                part = each if driver.type == CAPTURE else each.planes[0]
                offset = part.m.offset if driver.type == CAPTURE else part.m.mem_offset
                self._maps.append(mmap.mmap(driver.fd, part.length, offset=offset))
                driver.call(v4l2.VIDIOC_QBUF, each)
            driver.call(v4l2.VIDIOC_STREAMON, ctypes.c_int(driver.type))
        except BaseException:
            self.close()
            raise

    def wait(self, timeout_s: float) -> tuple[bool, bool]:
        """Wait for a picture or an event.

        Returns:
            Whether there is a picture, and whether there is an event.

        Raises:
            OSError: ENODEV: the device is gone.
        """
        events = sum(found for _, found in self._poll.poll(timeout_s * 1000))
        gone = events & (select.POLLERR | select.POLLHUP | select.POLLNVAL)
        # An error without a picture: taking one says which.
        return bool(events & select.POLLIN or gone), bool(events & select.POLLPRI)

    def take(self) -> Filled:
        """Return the newest picture; those before it that were not taken in time are left out.

        They show as a gap in ``sequence``.

        Raises:
            OSError: EAGAIN: there is none; others as the driver answers.
        """
        self._give_back()
        self._taken = self._dequeued()
        while self._poll.poll(0) and (newer := self._next_if_any()) is not None:
            self._give_back()
            self._taken = newer
        return self._filled(self._taken)

    def _next_if_any(self) -> Any:
        try:
            return self._dequeued()
        except OSError:  # an event instead of a picture, or an error, which the next call finds
            return None

    def _filled(self, taken: Any) -> Filled:
        part = taken if self._driver.type == CAPTURE else taken.planes[0]
        start = 0 if self._driver.type == CAPTURE else part.data_offset
        data = np.frombuffer(self._maps[taken.index], np.uint8, part.bytesused - start, start)
        source = taken.flags & v4l2.V4L2_BUF_FLAG_TSTAMP_SRC_MASK
        return Filled(
            data,
            int(taken.sequence),
            self._clock.stamp_ns(taken.timestamp.tv_sec * 10**9 + taken.timestamp.tv_usec * 1000),
            source == v4l2.V4L2_BUF_FLAG_TSTAMP_SRC_SOE,
            bool(taken.flags & v4l2.V4L2_BUF_FLAG_ERROR),
        )

    def _dequeued(self) -> Any:
        return self._driver.call(v4l2.VIDIOC_DQBUF, self._buffer(0))

    def _give_back(self) -> None:
        taken, self._taken = self._taken, None
        if taken is not None:
            self._driver.call(v4l2.VIDIOC_QBUF, self._buffer(taken.index))

    def _buffer(self, index: int) -> Any:
        found = v4l2.v4l2_buffer()
        found.index, found.type, found.memory = index, self._driver.type, v4l2.V4L2_MEMORY_MMAP
        if self._driver.type != CAPTURE:
            found.planes = (v4l2.v4l2_plane * 1)()  # kept alive with it
            found.m.planes = ctypes.cast(found.planes, ctypes.POINTER(v4l2.v4l2_plane))
            found.length = 1
        return found

    def close(self) -> None:
        """Stop the device and free its buffers; safe to call twice."""
        for request, argument in (
            (v4l2.VIDIOC_STREAMOFF, ctypes.c_int(self._driver.type)),
            (v4l2.VIDIOC_REQBUFS, self._none()),
        ):
            with suppress(OSError):  # gone; what is left is freed when the device is closed
                self._driver.call(request, argument)
        maps, self._maps = self._maps, []
        for each in maps:
            with suppress(BufferError):  # a view of it is left; freed with that
                each.close()

    def _none(self) -> Any:
        wanted = v4l2.v4l2_requestbuffers()
        wanted.type, wanted.memory = self._driver.type, v4l2.V4L2_MEMORY_MMAP
        return wanted


class Clock:
    """Converts a driver's time stamps, of a clock that drivers do not state reliably.

    ``uvcvideo`` can be told to use the wall clock, and still says that it is the monotonic one.
    """

    def __init__(self) -> None:
        self._read_ns: Any = None

    def stamp_ns(self, filled_ns: int) -> int | None:
        """Return a stamp as ns since 1970; None if it fits no known clock."""
        if self._read_ns is None:
            for read_ns in (time.monotonic_ns, time.time_ns):
                if -MAX_AHEAD_S < (read_ns() - filled_ns) / 1e9 < MAX_AGE_S:
                    self._read_ns = read_ns
                    break
        if self._read_ns is None or filled_ns <= 0:
            return None
        age_ns = self._read_ns() - filled_ns
        return time.time_ns() - max(0, age_ns) if age_ns > -MAX_AHEAD_S * 1e9 else None
