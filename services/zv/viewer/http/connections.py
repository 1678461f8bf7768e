"""TCP connections: a deadline for the first request, and a limit for those that are idle."""

from __future__ import annotations

import asyncio
import time
from typing import cast

FIRST_REQUEST_S = 5.0
"""Time in which a client must complete its first request."""

MAX_IDLE = 128
"""Limit of connections without a request; a further one closes the one idle for longest."""

LEFT_S = 20.0
"""A client that reads nothing for this long is disconnected."""

PROGRESS_S = 0.5


class Connection(asyncio.Protocol):
    """Wraps the protocol that answers requests, and measures how long the client does not read.

    A client that never completes its first request, as in a slowloris attack, is disconnected
    after ``FIRST_REQUEST_S``. Later requests have the limit of the wrapped protocol.

    ``idle`` has the server's connections without a request, the one idle for longest first.
    """

    _transport: asyncio.Transport
    _layers: tuple[asyncio.WriteTransport, ...]
    """The transport, and with TLS also the one beneath, which has a buffer of its own."""

    _deadline: asyncio.TimerHandle

    def __init__(self, inner: asyncio.Protocol, idle: dict[Connection, None]) -> None:
        self._inner = inner
        self._idle = idle
        self._stalled_since_s: float | None = None
        self._unsent = 0
        self._progress: asyncio.TimerHandle | None = None

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Start the deadline."""
        self._transport = cast("asyncio.Transport", transport)
        beneath = getattr(getattr(transport, "_ssl_protocol", None), "_transport", None)
        self._layers = (self._transport, *([beneath] if beneath is not None else []))
        # Buffer nothing here beyond the data being sent, so that the next picture is a new one.
        # With a limit of 0, TLS would never go on.
        for layer in self._layers:
            layer.set_write_buffer_limits(high=1, low=0)
        self._deadline = asyncio.get_running_loop().call_later(FIRST_REQUEST_S, self.abort)
        self._inner.connection_made(transport)
        self.end_request()

    def connection_lost(self, exc: Exception | None) -> None:
        """Forget the connection."""
        self.begin_request()
        self._end_progress()
        self._inner.connection_lost(exc)

    def data_received(self, data: bytes) -> None:
        """Forward the data."""
        self._inner.data_received(data)

    def eof_received(self) -> bool | None:
        """Forward the end."""
        return self._inner.eof_received()

    def pause_writing(self) -> None:
        """Begin to measure for how long the client does not read."""
        self._stalled_since_s = time.monotonic()
        self._unsent = self._buffered_bytes()
        self._check_progress()
        self._inner.pause_writing()

    def resume_writing(self) -> None:
        """Note that the client has read everything."""
        self._end_progress()
        self._inner.resume_writing()

    def _check_progress(self) -> None:
        unsent = self._buffered_bytes()
        if unsent < self._unsent:
            self._stalled_since_s = time.monotonic()
        self._unsent = unsent
        if self.stalled_s > LEFT_S:
            self.abort()
        else:
            loop = asyncio.get_running_loop()
            self._progress = loop.call_later(PROGRESS_S, self._check_progress)

    def _buffered_bytes(self) -> int:
        return sum(layer.get_write_buffer_size() for layer in self._layers)

    def _end_progress(self) -> None:
        self._stalled_since_s = None
        if self._progress is not None:
            self._progress.cancel()

    @property
    def stalled_s(self) -> float:
        """Seconds for which the client has read nothing of the sent data; 0 if it has read all."""
        since_s = self._stalled_since_s
        return 0.0 if since_s is None else time.monotonic() - since_s

    def begin_request(self) -> None:
        """Note that a request has been received: end the deadline."""
        self._deadline.cancel()
        self._idle.pop(self, None)

    def end_request(self) -> None:
        """Note that there is no request; close another connection if too many have none."""
        if not self._transport.is_closing():
            self._idle[self] = None
            if len(self._idle) > MAX_IDLE:
                next(iter(self._idle)).abort()

    def abort(self) -> None:
        """Close the connection at once."""
        self.begin_request()
        self._transport.abort()
