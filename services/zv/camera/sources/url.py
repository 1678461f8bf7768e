"""A network camera: RTSP, JPEGs over HTTP, and other streams that libav opens."""

from __future__ import annotations

import errno
import logging
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Final
from urllib.parse import quote

import av
from av.container import InputContainer
from av.error import (
    FFmpegError,
    HTTPClientError,
    HTTPForbiddenError,
    HTTPNotFoundError,
    HTTPServerError,
    HTTPUnauthorizedError,
    InvalidDataError,
    ProtocolNotFoundError,
)

from zenoh_vision.error_text import without_password
from zenoh_vision.errors import SourceError, SourceLost
from zv.camera.sources.base import Source, TimedPicture
from zv.camera.sources.http_camera import open_http
from zv.camera.sources.http_request import STATUS_SENTENCES, check_authority, proxy_words
from zv.camera.sources.libav import NoVideo
from zv.camera.sources.libav_options import hardware
from zv.camera.sources.live_stream import LiveStream
from zv.camera.sources.recording import Recording

log = logging.getLogger(__name__)

QUICK: Final = {"analyzeduration": "100000", "probesize": "1000000"}
RTSP: Final = {"allowed_media_types": "video", "fflags": "nobuffer"}
QUEUE: Final = {"reorder_queue_size": "4"}
"""With a queue libav sees by TCP too what the server left out. TCP keeps the order of packets, so
they wait in it after a loss only; then four are soon there."""
TRANSPORTS: Final = {
    "auto": {"rtsp_flags": "prefer_tcp", **QUEUE},  # and what the server allows if it refuses that
    "tcp": {"rtsp_transport": "tcp", **QUEUE},
    "udp": {"rtsp_transport": "udp"},
}
READ_MARGIN_S: Final = 0.5
"""Time beyond the time-out after which libav gives a call up itself."""

SENTENCES: Final = (
    (HTTPUnauthorizedError, STATUS_SENTENCES[401]),
    (HTTPForbiddenError, STATUS_SENTENCES[403]),
    (HTTPNotFoundError, STATUS_SENTENCES[404]),
    (HTTPClientError, "the server refused the request (4xx)"),
    (HTTPServerError, "the server failed (5xx)"),
    (ConnectionRefusedError, "nobody listens there (connection refused)"),
    ((ConnectionResetError, BrokenPipeError), "the server closed the connection"),
    (MemoryError, "the server sends a picture that is far too large, or has no end"),
    (InvalidDataError, "the server sends no video, or a damaged one"),
    (ProtocolNotFoundError, "libav is built without this protocol; a program that has it can be "
     "the source: command:PROGRAM ARGS"),
)  # fmt: skip


@dataclass(frozen=True, slots=True)
class UrlOptions:
    """How a URL is opened and read.

    Attributes:
        timeout_s: Longest time to open, and to wait for a picture.
        username: User for the camera; None for the one in the URL.
        password: As it is, without escapes; None for the one in the URL.
        transport: Of RTSP: ``tcp``, ``udp``, or ``auto``, TCP unless the server refuses it.
        libav: Further options of libav.
        hwaccel: Hardware that decodes: ``auto``, ``none`` or a kind that libav knows.
        video_stream: Which of several videos, from 0.
        rate_hz: Returns the rate at which a single picture is asked for; None for 1 Hz.
        max_lag_s: Returns the longest time from the capture to the decoder; 0 for no limit.
    """

    timeout_s: float = 5.0
    username: str | None = None
    password: str | None = None
    transport: str = "auto"
    libav: Mapping[str, str] = field(default_factory=dict)
    hwaccel: str = "auto"
    video_stream: int = 0
    rate_hz: Callable[[], float | None] = lambda: None
    max_lag_s: Callable[[], float] = lambda: 0.5


def open_url(url: str, options: UrlOptions | None = None) -> Source:
    """Open a network camera.

    JPEGs are passed on undecoded. Opening, and each wait for a picture, end after ``timeout_s``
    whatever the server does, except for the operating system's look-up of the host name.
    Certificates of ``https`` and ``rtsps`` are not checked, since cameras sign their own.

    Args:
        url: ``rtsp:// rtsps:// http:// https://`` or another scheme that libav has;
            ``user:password@`` is never shown.
        options: How it is opened and read.

    Raises:
        SourceError: The server does not answer, refuses, or sends no video.
    """
    options = options or UrlOptions()
    shown = without_password(url)
    check_authority(url, shown)
    scheme, _, rest = url.partition("://")
    url = f"{scheme.lower()}://{rest}"
    if options.username is not None or options.password is not None:
        url = _with_credentials(url, options.username, options.password)
    if scheme.lower() in ("http", "https"):
        camera = open_http(url, shown, options.timeout_s, options.rate_hz, options.max_lag_s)
        if camera is not None:
            return camera
    return UrlSource(url, shown, options)


class UrlSource:
    """Pictures of a URL that libav opens.

    A recording, which has an end, plays at its own pace like a file. So does a live stream in
    segments (HLS): its stamps are the times when its pictures are due, as their capture is unknown.

    Raises:
        SourceError: The server does not answer, refuses, or sends no video.
    """

    def __init__(self, url: str, shown: str, options: UrlOptions) -> None:
        self._url = url
        self._shown = shown
        self._timeout_s = options.timeout_s
        container = self._open(options)
        is_hls = container.format.name == "hls"
        self._ends = container.duration is not None
        self.live = not self._ends
        try:
            self._stream = (
                Recording(container, options.timeout_s, options.video_stream)
                if self._ends or is_hls
                else LiveStream(
                    container, options.timeout_s, options.max_lag_s, options.video_stream
                )
            )
        except NoVideo as error:
            container.close()
            raise SourceError(f"{shown}: no video: {error}") from None
        self.rate_hz = self._stream.rate_hz if isinstance(self._stream, Recording) else None
        self.description = f"{shown} ({self._stream.summary})"
        self._say_decoder(container, options.hwaccel)
        self._says_clock = isinstance(self._stream, LiveStream)

    def read(self) -> TimedPicture | None:
        """Return the next picture; None at the end of a recording.

        Raises:
            SourceLost: The server stalled, ended the stream, or sends nothing usable.
        """
        started_s = time.monotonic()
        try:
            picture = self._stream.read()
        except (FFmpegError, TimeoutError) as error:
            raise SourceLost(f"{self._shown}: {self._explain(error, started_s)}") from None
        if picture is None and self.live:
            raise SourceLost(f"{self._shown}: the server ended the stream")
        self._needs_udp = False  # if nothing comes now, it is not for a firewall
        self._say_clock()
        return picture

    def close(self) -> None:
        """Close the connection; safe to call twice."""
        self._stream.close()

    def _open(self, options: UrlOptions) -> InputContainer:
        rtsp = RTSP | TRANSPORTS[options.transport] if self._url.startswith("rtsp") else {}
        self._needs_udp = bool(rtsp) and options.transport == "udp"
        found = self._hardware = hardware(options.hwaccel)
        started_s = time.monotonic()
        try:
            return av.open(
                self._url,
                options=QUICK | rtsp | dict(options.libav),
                timeout=(options.timeout_s, options.timeout_s + READ_MARGIN_S),
                metadata_errors="replace",
                hwaccel=None if found is None else found.accelerator,
            )
        except (FFmpegError, ValueError, OSError) as error:
            words = self._explain(error, started_s)
            raise SourceError(f"{self._shown}: {words}") from None

    def _say_decoder(self, container: InputContainer, wanted: str) -> None:
        """Say what decodes, once for each kind of video; JPEGs are passed on."""
        context = container.streams.video[0].codec_context
        found = self._hardware
        if context.name == "mjpeg" or wanted == "none":
            return
        if found is not None and context.is_hwaccel:
            log.info("%s: %s is decoded by %s", self._shown, context.name.upper(), found.kind)
        else:
            why = f"{found.kind} cannot" if found else "no hardware decoder works here"
            log.info("%s: %s is decoded by the CPU: %s", self._shown, context.name.upper(), why)

    def _say_clock(self) -> None:
        """Say once whose clock the stamps are of, when the camera has told its own."""
        if not self._says_clock or not isinstance(self._stream, LiveStream):
            return
        clock = self._stream.clock
        if clock.is_camera_clock:
            log.info("%s: stamps are of the camera's clock (RTCP sender reports)", self._shown)
        elif clock.ahead_s is not None:
            log.info(
                "%s: the camera's clock is %+.1f s from this machine's, so stamps are of this "
                "machine's, counted from the picture that came fastest",
                self._shown,
                clock.ahead_s,
            )
        else:
            return
        self._says_clock = False

    def _losses(self) -> str:
        """Return what the network did to the pictures that did not come; empty if unknown."""
        stream = getattr(self, "_stream", None)  # none while it is opened
        lost = stream.packets_lost if isinstance(stream, LiveStream) else 0
        if lost:
            return f": {lost} packets were lost, and no whole key picture came"
        return "; nothing came by UDP, which a firewall may stop" if self._needs_udp else ""

    def _explain(self, error: Exception, started_s: float) -> str:
        # libav reports an interrupted call in many ways, so the clock decides.
        if time.monotonic() - started_s >= self._timeout_s or isinstance(error, TimeoutError):
            return f"no usable picture from the server for {self._timeout_s:g} s{self._losses()}"
        for kind, sentence in SENTENCES:
            if isinstance(error, kind):
                proxy = proxy_words(self._url) if isinstance(error, ConnectionError) else ""
                return sentence + proxy
        if isinstance(error, OSError) and error.errno == errno.EIO:
            return "the server ended the stream"
        if isinstance(error, OSError) and error.errno == errno.EPROTONOSUPPORT:
            return "the server refuses this transport of RTSP; set rtsp_transport"
        # Never the error itself: it contains the URL with the password.
        text = getattr(error, "strerror", None) or str(error)
        return text.replace(self._url, self._shown)


def _with_credentials(url: str, username: str | None, password: str | None) -> str:
    """Return a URL with a user and a password, those given instead of those in it."""
    scheme, _, rest = url.partition("://")
    authority, slash, path = rest.partition("/")
    before, _, host = authority.rpartition("@")
    old_user, _, old_password = before.partition(":")
    user = old_user if username is None else quote(username, safe="")
    secret = old_password if password is None else quote(password, safe="")
    return f"{scheme}://{user}:{secret}@{host}{slash}{path}"
