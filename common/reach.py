"""Whether anything answers at an endpoint, and how far away it is."""

from __future__ import annotations

import re
import select
import socket
import time
from collections.abc import Callable, Iterable

POLL_S = 0.1
OVER_TCP = re.compile(r"(?:tcp|tls|ws|wss)/\[?([^?#]+?)\]?:(\d+)(?:[?#].*)?")


def round_trip_s(
    endpoints: Iterable[str], timeout_s: float, stopping: Callable[[], bool] = lambda: False
) -> float | None:
    """Return how long the first endpoint takes to answer that does, seconds.

    Args:
        endpoints: Of Zenoh. One that is not over TCP counts as near, since it cannot be asked.
        timeout_s: For each.
        stopping: Ends the waiting.

    Returns:
        None if none answers.
    """
    for endpoint in endpoints:
        found = OVER_TCP.fullmatch(endpoint)
        if found is None:
            return 0.0
        took_s = _connecting_s(found[1], int(found[2]), timeout_s, stopping)
        if took_s is not None:
            return took_s
    return None


def _connecting_s(
    host: str, port: int, timeout_s: float, stopping: Callable[[], bool]
) -> float | None:
    try:
        found = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)
    except OSError:
        return None
    for family, kind, protocol, _, address in found:
        began_s = time.monotonic()
        with socket.socket(family, kind, protocol) as asking:
            asking.setblocking(False)
            asking.connect_ex(address)
            answers = select.poll()  # unlike select, also where thousands of files are open
            answers.register(asking, select.POLLOUT)
            while not stopping() and time.monotonic() - began_s < timeout_s:
                if answers.poll(POLL_S * 1000):
                    if asking.getsockopt(socket.SOL_SOCKET, socket.SO_ERROR) == 0:
                        return time.monotonic() - began_s
                    break
    return None
