"""A network camera: RTSP, MJPEG over HTTP, and other formats that libav opens over HTTP."""

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

from zenoh_vision.errors import SourceError, SourceLost
from zv.camera.sources.base import Picture
from zv.camera.sources.kinds import without_password
from zv.camera.sources.libav import AvStream, NoVideo

QUICK: Final = {"analyzeduration": "100000", "probesize": "1000000"}
RTSP: Final = {
    "rtsp_transport": "tcp",
    "allowed_media_types": "video",
    "fflags": "nobuffer",
}
"""Not for HTTP, where "nobuffer" loses the first picture, the only one of a snapshot."""

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
    ((ConnectionResetError, BrokenPipeError), "the server closed the connection"),
    (MemoryError, "the server sends a picture that is far too large, or has no end"),
    (InvalidDataError, "the server sends no video, or a damaged one"),
)


class UrlSource(AvStream):
    """Pictures of a network camera.

    JPEGs are passed on undecoded. Opening, and each wait for a picture, end after ``timeout_s``
    whatever the server does, except for the operating system's look-up of the host name.

    A recording behind a URL, which has an end, plays at its own pace like a file. Certificates
    of ``https`` and ``rtsps`` are not checked, since cameras sign their own.

    Args:
        url: ``rtsp:// rtsps:// http:// https://``; ``user:password@`` is never shown.
        timeout_s: Longest time to open, and to wait for a picture.

    Raises:
        SourceError: The server does not answer, refuses, or sends no video.
    """

    _timeout_s: float

    def __init__(self, url: str, *, timeout_s: float = 5.0) -> None:
        self._url = url
        self._shown = without_password(url)
        options = QUICK | (RTSP if url.lower().startswith("rtsp") else {})
        started_s = time.monotonic()
        try:
            super().__init__(url, options=options, timeout_s=timeout_s, live=True)
        except NoVideo as error:
            raise SourceError(f"{self._shown}: no video: {error}") from None
        except (FFmpegError, ValueError) as error:
            raise SourceError(f"{self._shown}: {self._explain(error, started_s)}") from None
        if self.live:
            self.rate_hz = None
        self.description = f"{self._shown} ({self.summary})"

    def read(self) -> Picture | None:
        """Return the next picture; None at the end of a recording.

        Raises:
            SourceLost: The server stalled, ended the stream, or sends nothing usable.
        """
        started_s = time.monotonic()
        try:
            picture = super().read()
        except (FFmpegError, TimeoutError) as error:
            raise SourceLost(f"{self._shown}: {self._explain(error, started_s)}") from None
        if picture is None and self.live:
            raise SourceLost(f"{self._shown}: the server ended the stream")
        return picture

    def _explain(self, error: Exception, started_s: float) -> str:
        # libav reports an interrupted call in many ways, so the clock decides.
        if time.monotonic() - started_s >= self._timeout_s:
            return f"no usable picture from the server for {self._timeout_s:g} s"
        for kind, sentence in SENTENCES:
            if isinstance(error, kind):
                return sentence
        if isinstance(error, OSError) and error.errno == errno.EIO:
            return "the server ended the stream"
        # Never the error itself: it contains the URL with the password.
        text = getattr(error, "strerror", None) or str(error)
        return text.replace(self._url, self._shown)
