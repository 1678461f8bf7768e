"""A live stream of JPEGs, from a server or a program, with the times of their arrival."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable, Iterator
from typing import Final, Protocol

from zenoh_vision.errors import PayloadError, SourceError, SourceLost
from zenoh_vision.image.files import decoded
from zenoh_vision.image.picture import Picture
from zv.camera.sources.base import TimedPicture
from zv.camera.sources.http_request import HttpFailure
from zv.camera.sources.jpeg_splitter import EndlessPicture, JpegPacket, JpegSplitter
from zv.camera.sources.mjpeg import DamagedJpeg, upright_jpeg
from zv.camera.sources.packet_queue import PacketQueue
from zv.camera.sources.stream_clock import StreamClock, stamp_ns

log = logging.getLogger(__name__)

CLOSE_S: Final = 2.0
GAP_S: Final = 0.5
"""After nothing came for so long, what waited in the network comes at once: only the newest of it
is shown."""


class Sender(Protocol):
    """Who sends a stream of bytes."""

    @property
    def name(self) -> str:
        """Who it is, for people: ``the server``."""

    def chunks(self) -> Iterator[bytes]:
        """Yield the bytes of the stream as they come."""

    def interrupt(self) -> None:
        """End a wait for bytes, on any thread."""

    def close(self) -> None:
        """Close the connection."""

    def why_ended(self) -> str:
        """Return why the stream has ended, for people."""


class JpegStream:
    """Pictures of a stream of JPEGs, passed on undecoded; the newest if several wait.

    A picture is stamped with its arrival, or with the time that the server sends with it
    (``X-Timestamp``), counted from the picture that came fastest.

    Args:
        sender: Who sends the bytes.
        shown: What it is, without passwords.
        timeout_s: Longest time without a usable picture.
        max_lag_s: Returns the longest time that a picture may be old; 0 for no limit.

    Raises:
        SourceError: No picture comes.
    """

    live = True
    rate_hz: float | None = None

    def __init__(
        self,
        sender: Sender,
        shown: str,
        timeout_s: float,
        max_lag_s: Callable[[], float],
    ) -> None:
        self._sender = sender
        self._shown = shown
        self._timeout_s = timeout_s
        self._max_lag_s = max_lag_s
        self._clock = StreamClock()
        self._last_s: float | None = None
        self._last_ns = 0
        self._warned = False
        self._queue = PacketQueue(self._packets(), sender.close, self._arrive, sender.interrupt)
        try:
            self._first: TimedPicture | None = self._next()
        except SourceLost as error:
            self.close()
            raise SourceError(str(error)) from None
        size = "x".join(map(str, self._first.picture.size))
        self.description = f"{shown} ({size}, MJPEG)"

    def read(self) -> TimedPicture:
        """Return the next picture.

        Raises:
            SourceLost: The server stalled, ended the stream, or sends nothing usable.
        """
        first, self._first = self._first, None
        return first or self._next()

    def close(self) -> None:
        """Close the connection; safe to call twice."""
        self._queue.close(self._timeout_s + CLOSE_S)

    def _packets(self) -> Iterator[JpegPacket]:
        splitter = JpegSplitter()
        for chunk in self._sender.chunks():
            yield from splitter.feed(chunk)

    def _arrive(self, packet: JpegPacket, arrived_s: float) -> None:
        if packet.time_s is not None:
            self._clock.arrive(packet.time_s, arrived_s)

    def _next(self) -> TimedPicture:
        deadline_s = time.monotonic() + self._timeout_s
        skipped = 0
        while True:
            try:
                arrival = self._queue.take(max(0.0, deadline_s - time.monotonic()))
            except TimeoutError:
                wait = f"no usable picture from {self._sender.name} for {self._timeout_s:g} s"
                raise SourceLost(f"{self._shown}: {wait}") from None
            except EndlessPicture:
                endless = "sends a picture that is far too large, or has no end"
                raise SourceLost(f"{self._shown}: {self._sender.name} {endless}") from None
            except HttpFailure as error:
                raise SourceLost(f"{self._shown}: {error}") from None
            if arrival is None:
                raise SourceLost(f"{self._shown}: {self._sender.why_ended()}")
            packet, arrived_s = arrival.packet, arrival.arrived_s
            captured_s = self._captured_s(packet, arrived_s)
            gap_s = 0.0 if self._last_s is None else arrived_s - self._last_s
            self._last_s = arrived_s
            max_lag_s = self._max_lag_s()
            late = time.monotonic() - captured_s > max_lag_s > 0
            if late or (gap_s > GAP_S and packet.time_s is None and max_lag_s):
                self._queue.settle()
                newer = self._queue.skip_to_newest_key()
                if newer is not None:
                    skipped += 1 + newer
                    continue
            picture = self._usable(packet.data)
            if picture is not None:
                age_s = time.monotonic() - captured_s
                self._last_ns = stamp_ns(age_s, time.time_ns(), self._last_ns)
                skipped += self._queue.taken_overflow()
                return TimedPicture(picture, stamp_ns=self._last_ns, skipped=skipped)

    def _captured_s(self, packet: JpegPacket, arrived_s: float) -> float:
        found = None if packet.time_s is None else self._clock.captured_s(packet.time_s)
        return arrived_s if found is None else found

    def _usable(self, data: bytes) -> Picture | None:
        try:
            return upright_jpeg(data) or decoded(data)
        except (DamagedJpeg, ValueError, PayloadError) as error:
            level = logging.DEBUG if self._warned else logging.WARNING
            log.log(level, "%s: a damaged picture was skipped: %s", self._shown, error)
            self._warned = True
            return None
