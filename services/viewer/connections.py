"""Connections before and between requests: few, short, and none of them in another's way."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Callable
from typing import cast

FIRST_REQUEST_S = 5.0
"""So long a client may take to say what it wants."""

MAX_IDLE = 128
"""Connections without a request; one more ends the one that has been idle longest."""


class Connections:
    """All connections of one viewer.

    Args:
        handler: Makes what answers requests on one connection.
    """

    def __init__(self, handler: Callable[[], asyncio.Protocol]) -> None:
        self._handler = handler
        self._idle: dict[Connection, None] = {}
        self._all: set[Connection] = set()
        self.refused = 0

    def __call__(self) -> Connection:
        """Return the protocol of a new connection."""
        connection = Connection(self, self._handler())
        self._all.add(connection)
        return connection

    def abort(self) -> None:
        """Leave all clients."""
        for connection in list(self._all):
            connection.abort()

    def gone(self, connection: Connection) -> None:
        """Forget a connection."""
        self._idle.pop(connection, None)
        self._all.discard(connection)

    def idle(self, connection: Connection) -> None:
        """Take note that a connection has no request; ends another if there are too many."""
        self._idle[connection] = None
        if len(self._idle) > MAX_IDLE:
            self.refused += 1
            oldest = next(iter(self._idle))
            oldest.abort()

    def busy(self, connection: Connection) -> None:
        """Take note that a connection has a request."""
        self._idle.pop(connection, None)


class Connection(asyncio.Protocol):
    """Passes everything on to the protocol that answers requests, and looks at the time.

    A client that begins a request and never ends it, as slowloris does, is left after
    ``FIRST_REQUEST_S``. Later requests are held to the handler's own limit.

    Args:
        every: Where it is counted.
        inner: What answers.
    """

    def __init__(self, every: Connections, inner: asyncio.Protocol) -> None:
        self._every = every
        self._inner = inner
        self._transport: asyncio.Transport | None = None
        self._deadline: asyncio.TimerHandle | None = None
        self._stalled_since_s: float | None = None

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Count it and start the clock."""
        self._transport = cast("asyncio.Transport", transport)
        # Nothing is buffered here beyond what is being sent: the next picture is a new one.
        self._transport.set_write_buffer_limits(high=0)
        self._deadline = asyncio.get_running_loop().call_later(FIRST_REQUEST_S, self.abort)
        self._inner.connection_made(transport)
        self._every.idle(self)

    def connection_lost(self, exc: Exception | None) -> None:
        """Forget it."""
        self.begin()
        self._every.gone(self)
        self._inner.connection_lost(exc)

    def data_received(self, data: bytes) -> None:
        """Pass it on."""
        self._inner.data_received(data)

    def eof_received(self) -> bool | None:
        """Pass it on."""
        return self._inner.eof_received()

    def pause_writing(self) -> None:
        """Pass it on, and take note that the client does not take what is sent."""
        self._stalled_since_s = time.monotonic()
        self._inner.pause_writing()

    def resume_writing(self) -> None:
        """Pass it on: the client has taken all."""
        self._stalled_since_s = None
        self._inner.resume_writing()

    @property
    def stalled_s(self) -> float:
        """For how long the client has not taken what was sent; 0 if it has."""
        since_s = self._stalled_since_s
        return 0.0 if since_s is None else time.monotonic() - since_s

    def begin(self) -> None:
        """Take note that a request is here and is being answered."""
        if self._deadline is not None:
            self._deadline.cancel()
            self._deadline = None
        self._every.busy(self)

    def finish(self) -> None:
        """Take note that the request has been answered."""
        if self._transport is not None and not self._transport.is_closing():
            self._every.idle(self)

    def abort(self) -> None:
        """Leave the client."""
        self.begin()
        if self._transport is not None:
            self._transport.abort()
