"""A camera over HTTP: a stream of JPEGs, or a picture that is asked for again and again."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable
from typing import Final

from zenoh_vision.errors import PayloadError, SourceError, SourceLost
from zenoh_vision.image.codecs import JPEG_START, MAX_COMPRESSED_BYTES
from zv.camera.sources.base import TimedPicture
from zv.camera.sources.http_request import Answer, HttpClient, HttpFailure
from zv.camera.sources.jpeg_stream import JpegStream
from zv.camera.sources.mjpeg import upright_picture

log = logging.getLogger(__name__)

SNAPSHOT_HZ: Final = 1.0
STREAM_TYPES: Final = ("multipart/x-mixed-replace", "multipart/mixed", "multipart/related")


def open_http(
    url: str,
    shown: str,
    timeout_s: float,
    rate_hz: Callable[[], float | None],
    max_lag_s: Callable[[], float],
) -> JpegStream | Snapshots | None:
    """Open a camera that sends JPEGs over HTTP; None if it sends something else.

    Args:
        url: ``http://`` or ``https://``.
        shown: The URL without passwords.
        timeout_s: Longest time without a picture.
        rate_hz: Returns the rate at which a single picture is asked for; None for 1 Hz.
        max_lag_s: Returns the longest time that a picture may wait here; 0 for no limit.

    Raises:
        SourceError: The server does not answer, or refuses.
    """
    client = HttpClient(url, timeout_s)
    try:
        answer = client.get()
        if answer.kind.startswith("image/"):
            return Snapshots(client, answer, shown, rate_hz)
    except HttpFailure as error:
        raise SourceError(f"{shown}: {error}") from None
    try:
        first = answer.peek()
    except HttpFailure as error:
        answer.close()
        raise SourceError(f"{shown}: {error}") from None
    if answer.kind in STREAM_TYPES or first.startswith((JPEG_START, b"--")):
        answer.limit.end()
        return JpegStream(answer, shown, timeout_s, max_lag_s)
    answer.close()
    return None


class Snapshots:
    """A picture behind a URL, asked for at a rate. All of its pictures are one epoch.

    Its stamps are the times at which the answers began.
    """

    live = True

    def __init__(
        self,
        client: HttpClient,
        answer: Answer,
        shown: str,
        rate_hz: Callable[[], float | None],
    ) -> None:
        self._client = client
        self._shown = shown
        self._wanted_hz = rate_hz
        self._due_s = 0.0
        self._first: TimedPicture | None = self._picture(answer)  # closes it, whatever happens
        self.rate_hz: float | None = rate_hz() or SNAPSHOT_HZ
        size = "x".join(map(str, self._first.picture.size))
        self.description = f"{shown} ({size}, a picture each {1 / self.rate_hz:.3g} s)"

    def next_due_s(self) -> float:
        """Return when the next picture is to be asked for, seconds since the first."""
        if self._first is not None:
            return 0.0
        return self._due_s + 1.0 / (self._wanted_hz() or SNAPSHOT_HZ)

    def read(self) -> TimedPicture:
        """Ask for the picture, and return it.

        Raises:
            SourceLost: The server does not answer, refuses, or sends no picture.
        """
        first, self._first = self._first, None
        if first is not None:
            return first
        self._due_s = self.next_due_s()
        try:
            return self._picture(self._client.get())
        except (HttpFailure, SourceError) as error:
            reason = str(error).removeprefix(f"{self._shown}: ")
            raise SourceLost(f"{self._shown}: {reason}") from None

    def close(self) -> None:
        """Do nothing: no connection stays open."""

    def _picture(self, answer: Answer) -> TimedPicture:
        stamp_ns = time.time_ns()
        data = bytearray()
        try:
            while chunk := answer.read():
                data += chunk
                if len(data) > MAX_COMPRESSED_BYTES:
                    raise SourceError(
                        f"{self._shown}: the server sends a picture that is far too large, or has "
                        "no end"
                    )
            return TimedPicture(upright_picture(bytes(data)), stamp_ns=stamp_ns)
        except HttpFailure as error:
            raise SourceError(f"{self._shown}: {error}") from None
        except (ValueError, PayloadError) as error:
            raise SourceError(f"{self._shown}: the picture cannot be used: {error}") from None
        finally:
            answer.close()
