"""Reads a recording with libav, from a file or a URL, at its own pace, by the times in it."""

from __future__ import annotations

import logging
import time
from collections.abc import Iterator

from av.container import InputContainer
from av.format import Flags
from av.packet import Packet
from av.stream import Stream

from zv.camera.sources.base import TimedPicture
from zv.camera.sources.libav import DEFAULT_RATE_HZ, Decoded, VideoDecoder, video_stream


class Recording:
    """The pictures of an open container, each with the time when it is due.

    Args:
        container: Owned from now on; on an error it is left open.
        timeout_s: Longest time to wait for a picture; None for no limit.
        number: Which of its videos, from 0.

    Attributes:
        rate_hz: The stream's own rate; None if it states none.
        summary: Size and codec, for people.

    Raises:
        NoVideo: It has no video.
    """

    def __init__(
        self, container: InputContainer, timeout_s: float | None = None, number: int = 0
    ) -> None:
        self._container = container
        self._timeout_s = timeout_s
        self._decoder = VideoDecoder(video_stream(container, number), low_delay=False)
        # All streams, so that sound alone cannot keep the loop in libav forever.
        self._packets: Iterator[Packet[Stream]] = iter(container.demux())
        self._decoded: Iterator[Decoded] = iter(())
        self.rate_hz = self._decoder.rate_hz
        self.summary = self._decoder.summary
        jumps = Flags.ts_discont in Flags(container.format.flags)
        self._timeline = Timeline(
            self.rate_hz or DEFAULT_RATE_HZ, MAX_GAP_OF_BROADCAST_S if jumps else MAX_GAP_S
        )

    def read(self) -> TimedPicture | None:
        """Return the next picture, None at the end or after ``close``.

        Raises:
            FFmpegError: Reading failed.
            TimeoutError: No picture came within the time limit.
        """
        started_s = time.monotonic()
        while (found := next(self._decoded, None)) is None:
            if self._timeout_s is not None and time.monotonic() - started_s > self._timeout_s:
                raise TimeoutError
            packet = next(self._packets, None)
            if packet is None:
                return None
            self._decoded = self._decoder.decode(packet)
        return TimedPicture(found.picture, due_s=self._timeline.due_s(found.time_s))

    def close(self) -> None:
        """Close it; safe to call twice."""
        self._packets = iter(())
        self._decoded = iter(())
        self._container.close()


log = logging.getLogger(__name__)

MAX_GAP_S = 3600.0
MAX_GAP_OF_BROADCAST_S = 10.0
"""Longest pause between two pictures that is taken for one. Clocks of formats for transmission,
such as MPEG-TS, may jump where recordings were joined; ffplay has the same two limits."""


class Timeline:
    """Computes when each picture of a recording is due; jumps of its clock are closed.

    Args:
        rate_hz: Rate of pictures whose time is missing, runs backwards or jumps.
        max_gap_s: The longest pause; a longer one is a jump of the clock.
    """

    def __init__(self, rate_hz: float, max_gap_s: float = MAX_GAP_S) -> None:
        self._period_s = 1.0 / rate_hz
        self._max_gap_s = max_gap_s
        self._origin_s: float | None = None
        self._last_s = -self._period_s
        self._warned = False

    def due_s(self, time_s: float | None) -> float:
        """Return when the next picture is due, seconds since the first; never decreases.

        Args:
            time_s: Its time on the recording's clock, with any origin; None if it has none.
        """
        due_s = None if time_s is None or self._origin_s is None else time_s - self._origin_s
        if due_s is None or not self._last_s <= due_s <= self._last_s + self._max_gap_s:
            if due_s is not None:
                self._warn(due_s - self._last_s)
            due_s = self._last_s + self._period_s
            # From here on the recording's clock is used again, if it has one.
            self._origin_s = None if time_s is None else time_s - due_s
        self._last_s = due_s
        return due_s

    def _warn(self, jump_s: float) -> None:
        if not self._warned:
            log.warning("the clock of the video jumps by %+.3g s; it goes on at once", jump_s)
            self._warned = True
