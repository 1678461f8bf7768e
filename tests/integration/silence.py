"""A listener that takes connections and says nothing."""

from __future__ import annotations

import socket
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def silent_listener(port: int = 0) -> Iterator[tuple[int, list[float]]]:
    """Take connections and never say a word, like an address whose router is just away."""
    accepted: list[float] = []
    kept = []
    with socket.create_server(("127.0.0.1", port)) as listener:

        def accept() -> None:
            while True:
                try:
                    kept.append(listener.accept())
                except OSError:
                    return
                accepted.append(time.monotonic())

        thread = threading.Thread(target=accept, daemon=True)
        thread.start()
        yield listener.getsockname()[1], accepted
        listener.shutdown(socket.SHUT_RDWR)
    thread.join(5)
    for connection, _ in kept:
        connection.close()
