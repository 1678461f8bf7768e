"""A way to a router on which everything takes its time, more or less of it as a test goes on."""

from __future__ import annotations

import socket
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress

from tests.integration.routing import Router

ONE_WAY_S = 0.14
"""Four ways, for the two questions of Zenoh's handshake, are more than the brisk 0.3 s."""


class Way:
    """Carries what is sent to an endpoint to a router's, and back.

    Attributes:
        delay_s: How long each way takes.
        endpoint: Where it begins.
    """

    def __init__(self, router: Router, delay_s: float) -> None:
        self.delay_s = delay_s
        self._router = router
        self._listener = socket.create_server(("127.0.0.1", 0))
        self._ends: list[socket.socket] = []
        self.endpoint = f"tcp/127.0.0.1:{self._listener.getsockname()[1]}"
        self._thread = threading.Thread(target=self._connect, daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Cut all connections."""
        self._listener.shutdown(socket.SHUT_RDWR)
        self._thread.join(5)
        self._listener.close()
        for end in self._ends:
            end.close()

    def _connect(self) -> None:
        while True:
            try:
                here, _ = self._listener.accept()
            except OSError:
                return
            self._ends.append(here)
            try:
                there = socket.create_connection(("127.0.0.1", self._router.port))
            except OSError:
                here.close()
                continue
            self._ends.append(there)
            for pair in ((here, there), (there, here)):
                threading.Thread(target=self._carry, args=pair, daemon=True).start()

    def _carry(self, source: socket.socket, target: socket.socket) -> None:
        with suppress(OSError):
            while data := source.recv(65536):
                time.sleep(self.delay_s)
                target.sendall(data)
        with suppress(OSError):
            target.shutdown(socket.SHUT_RDWR)


@contextmanager
def far(router: Router, delay_s: float = 0.0) -> Iterator[Way]:
    """Yield a way to a router that lasts as long as the context."""
    way = Way(router, delay_s)
    try:
        yield way
    finally:
        way.close()
