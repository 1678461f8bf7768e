"""A camera behind a URL: RTSP, MJPEG over HTTP, and what else libav opens over HTTP."""

from __future__ import annotations

import errno
import time
from typing import Final

from av.error import (
    FFmpegError,
    HTTPClientError,
    HTTPForbiddenError,
    HTTPNotFoundError,
    HTTPServerError,
    HTTPUnauthorizedError,
    InvalidDataError,
)

from common.errors import SourceError, SourceLost
from services.camera.sources import without_password
from services.camera.sources.base import Picture
from services.camera.sources.libav import Footage, NoVideo
from services.camera.sources.video import DEFAULT_RATE_HZ, Timeline, timed

QUICK: Final = {"analyzeduration": "100000", "probesize": "1000000"}
RTSP: Final = {
    "rtsp_transport": "tcp",
    "allowed_media_types": "video",
    "fflags": "nobuffer",
}
"""Over HTTP "nobuffer" would only lose the first picture, and a snapshot has no other."""

SENTENCES: Final = (
    (
        HTTPUnauthorizedError,
        "user or password is missing or wrong (401); write user:password@ before the host",
    ),
    (HTTPForbiddenError, "access is forbidden (403)"),
    (HTTPNotFoundError, "the server has no such path (404)"),
    (HTTPClientError, "the server refused the request (4xx)"),
    (HTTPServerError, "the server failed (5xx)"),
    (ConnectionRefusedError, "nobody listens there (connection refused)"),
    (ConnectionResetError, "the server broke the connection off"),
    (InvalidDataError, "what the server sends is no video, or a damaged one"),
    (BrokenPipeError, "the server broke the connection off"),
)


class UrlSource:
    """Pictures of a network camera.

    Its JPEGs come through undecoded. Opening, and each wait for a picture, end after
    ``timeout_s`` whatever the server does; only the look-up of a host name is the operating
    system's and takes as long as that takes. ``close`` from another thread does not interrupt a
    ``read``: that one ends by its time-out and then closes the connection itself.

    A recording behind a URL, which has an end, plays at its own pace like a file. Certificates
    of ``https`` and ``rtsps`` are not checked, since cameras sign their own.

    Args:
        url: ``rtsp:// rtsps:// http:// https://``; ``user:password@`` is never shown.
        timeout_s: Longest time to open, and to wait for a picture.

    Raises:
        SourceError: The server does not answer, refuses, or sends no video.
    """

    def __init__(self, url: str, *, timeout_s: float = 5.0) -> None:
        self._url = url
        self._shown = without_password(url)
        self._timeout_s = timeout_s
        options = QUICK | (RTSP if url.lower().startswith("rtsp") else {})
        started_s = time.monotonic()
        try:
            self._footage = Footage(url, options=options, timeout_s=timeout_s, live=True)
        except NoVideo as error:
            raise SourceError(f"{self._shown}: no video: {error}") from None
        except (FFmpegError, ValueError) as error:
            raise SourceError(f"{self._shown}: {self._explain(error, started_s)}") from None
        self.live = not self._footage.has_end
        self.rate_hz = self._footage.rate_hz if not self.live else None
        self._timeline = Timeline(self.rate_hz or DEFAULT_RATE_HZ)
        self.description = f"{self._shown} ({self._footage.summary})"

    def read(self) -> Picture | None:
        """Return the next picture; None at the end of a recording.

        Raises:
            SourceLost: The server stalled, ended the stream, or sends nothing usable.
        """
        started_s = time.monotonic()
        try:
            shot = self._footage.read()
        except TimeoutError:
            raise SourceLost(f"{self._shown}: {self._stalled()}") from None
        except FFmpegError as error:
            raise SourceLost(f"{self._shown}: {self._explain(error, started_s)}") from None
        if shot is not None:
            return shot.picture if self.live else timed(shot, self._timeline)
        if self.live:
            reason = "closed" if self._footage.closed else "the server ended the stream"
            raise SourceLost(f"{self._shown}: {reason}")
        return None

    def close(self) -> None:
        """Close the connection, or have the reading thread close it; safe to call twice."""
        self._footage.close()

    def _explain(self, error: Exception, started_s: float) -> str:
        # libav reports an interrupted call in many ways, so the clock decides.
        if time.monotonic() - started_s >= self._timeout_s:
            return self._stalled()
        for kind, sentence in SENTENCES:
            if isinstance(error, kind):
                return sentence
        if isinstance(error, OSError) and error.errno == errno.EIO:
            return "the server ended the stream"
        # Never the error itself: it ends with the URL, password and all.
        text = getattr(error, "strerror", None) or str(error)
        return text.replace(self._url, self._shown)

    def _stalled(self) -> str:
        return f"no usable picture from the server for {self._timeout_s:g} s"
