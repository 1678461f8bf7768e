"""Keeps a router's connections from holding it up when it closes them.

Zenoh has the system wait up to 10 s for what a client has not read (SO_LINGER, zenoh #1101), on a
thread of its own, and gives up closing after 10 s. Frozen guests thus kept who was revoked in the
system for 20 s, and then ended the router.
"""

from __future__ import annotations

import os
import socket
import struct
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Final

OWN_FILES: Final = Path("/proc/self/fd")
NO_WAIT: Final = struct.pack("ii", 0, 0)


def close_without_waiting() -> None:
    """Have the system send the rest in the background once a connection is closed."""
    for connection in _connections():
        with suppress(OSError):
            connection.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, NO_WAIT)


def cut_connections() -> None:
    """End every connection of this process, whatever the other side does."""
    close_without_waiting()
    for connection in _connections():
        with suppress(OSError):
            connection.shutdown(socket.SHUT_RDWR)


def _connections() -> Iterator[socket.socket]:
    """Yield the TCP connections of this process."""
    for name in os.listdir(OWN_FILES):
        # What is closed meanwhile, is no socket or has no other side is none.
        with suppress(OSError):
            if not os.readlink(OWN_FILES / name).startswith("socket:"):
                continue
            with socket.socket(fileno=os.dup(int(name))) as one:
                if one.family in (socket.AF_INET, socket.AF_INET6) and one.getpeername():
                    yield one
