"""The socket that browsers reach, and the address to tell people."""

from __future__ import annotations

import contextlib
import errno
import socket
import sys

from common.errors import ConfigurationError

BACKLOG = 512
SEND_BUFFER_BYTES = 256 << 10
"""Of the kernel, for each client: what one that stops reading costs at most."""

UNSENT_BYTES = 16 << 10
"""What the kernel takes before it has sent the rest, so that the next picture is a new one."""

FLAG = "--port PORT, or ZV_VIEWER_PORT=PORT"
ANY = ("0.0.0.0", "::")  # noqa: S104 - compared, not bound
ELSEWHERE = ("192.0.2.1", 9)
"""An address of the documentation's; nothing is sent to it."""


def listen(host: str, port: int, way_out: str = FLAG) -> socket.socket:
    """Return a socket that listens.

    Args:
        host: Name or address.
        port: 0 for one that is free.
        way_out: How whoever started this sets another port.

    Raises:
        ConfigurationError: That is not possible; says why and the way out.
    """
    try:
        family, _, _, _, address = socket.getaddrinfo(
            host.strip("[]"), port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE
        )[0]
        listening = socket.socket(family, socket.SOCK_STREAM)
    except (OSError, UnicodeError) as error:
        raise ConfigurationError(_why_not(host, port, way_out, error)) from None
    try:
        listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        # Every connection inherits these.
        listening.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, SEND_BUFFER_BYTES)
        if sys.platform == "linux":
            with contextlib.suppress(OSError):
                listening.setsockopt(socket.IPPROTO_TCP, socket.TCP_NOTSENT_LOWAT, UNSENT_BYTES)
        listening.bind(address)
        listening.listen(BACKLOG)
        listening.setblocking(False)
    except OSError as error:
        listening.close()
        raise ConfigurationError(_why_not(host, port, way_out, error)) from None
    return listening


def free_port(host: str, port: int, way_out: str = FLAG) -> int:
    """Return the port if it can be listened on, or one that is free for 0.

    Args:
        host: As for ``listen``, as are the others.
        port: The same.
        way_out: The same.

    Raises:
        ConfigurationError: It cannot.
    """
    with listen(host, port, way_out) as probe:
        found: int = probe.getsockname()[1]
        return found


def url(host: str, port: int, token: str | None, address: str = "") -> str:
    """Return the address to open in a browser, with the token in it if one is needed.

    Args:
        host: Where it listens.
        port: The same.
        token: What browsers must know.
        address: How they reach it, if it is not by host and port.
    """
    ending = f"?token={token}" if token else ""
    if address:
        return f"{address.rstrip('/')}/{ending}"
    shown = host.strip("[]")
    if shown in ANY:
        shown = address_of_this_machine()
    shown = f"[{shown}]" if ":" in shown else shown
    return f"http://{shown}:{port}/{ending}"


def address_of_this_machine() -> str:
    """Return the address that this machine has on the way out; its name if there is no way."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            probe.connect(ELSEWHERE)
        except OSError:
            return socket.gethostname()
        address: str = probe.getsockname()[0]
        return address


def _why_not(host: str, port: int, way_out: str, error: OSError | UnicodeError) -> str:
    if getattr(error, "errno", None) == errno.EADDRINUSE:
        return (
            f"port {port} on {host} is taken, perhaps by another viewer; serve on another with "
            f"{way_out}"
        )
    if getattr(error, "errno", None) == errno.EACCES:
        return f"port {port} on {host} is not permitted; allowed: 1024 or above, with {way_out}"
    said = getattr(error, "strerror", None) or error
    return f"host = {host!r} is not possible: {said}; allowed: an address of this machine"
