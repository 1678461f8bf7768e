"""The listening socket, and the address under which browsers reach it."""

from __future__ import annotations

import contextlib
import errno
import ipaddress
import socket
import sys

from zenoh_vision.errors import ConfigurationError

BACKLOG = 512
SEND_BUFFER_BYTES = 256 << 10
"""The kernel's buffer for each client, which a client that stops reading fills."""

UNSENT_BYTES = 16 << 10
"""Limit of unsent data in the kernel, so that the next picture is a new one."""

PORT_FLAG = "--port PORT, or ZV_VIEWER_PORT=PORT"
ANY = ("0.0.0.0", "::")  # noqa: S104 - compared, not bound
DOCUMENTATION_ADDRESS = ("192.0.2.1", 9)
"""An address reserved for documentation; nothing is sent to it."""


def listen(host: str, port: int, remedy: str = PORT_FLAG) -> socket.socket:
    """Return a listening socket; port 0 chooses a free port.

    Raises:
        ConfigurationError: The address cannot be used; the text has the reason and ``remedy``,
            which says how to set another port.
    """
    with contextlib.ExitStack() as cleanup:
        try:
            family, _, _, _, address = socket.getaddrinfo(
                host.strip("[]"), port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE
            )[0]
            listening = cleanup.enter_context(socket.socket(family, socket.SOCK_STREAM))
            listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            # Every connection inherits these.
            listening.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, SEND_BUFFER_BYTES)
            if sys.platform == "linux":
                with contextlib.suppress(OSError):
                    listening.setsockopt(socket.IPPROTO_TCP, socket.TCP_NOTSENT_LOWAT, UNSENT_BYTES)
            listening.bind(address)
            listening.listen(BACKLOG)
            listening.setblocking(False)
        except (OSError, UnicodeError) as error:
            raise ConfigurationError(_listen_error(host, port, remedy, error)) from None
        cleanup.pop_all()
        return listening


def free_port(host: str, port: int, remedy: str = PORT_FLAG) -> int:
    """Return the port if it can be listened on, or a free one for 0; errors as for ``listen``."""
    with listen(host, port, remedy) as probe:
        return int(probe.getsockname()[1])


def url(
    host: str, port: int, token: str | None, address: str = "", *, encrypted: bool = False
) -> str:
    """Return the URL to open in a browser, with the token in it if one is needed.

    ``address`` is the URL under which browsers reach the viewer, if not by host and port.
    """
    ending = f"?token={token}" if token else ""
    if address:
        return f"{address.rstrip('/')}/{ending}"
    shown = host.strip("[]")
    if shown in ANY:
        shown = address_of_this_machine()
    shown = f"[{shown}]" if ":" in shown else shown
    return f"http{'s' if encrypted else ''}://{shown}:{port}/{ending}"


def address_of_this_machine() -> str:
    """Return this machine's address on the default route, or its name if there is no route."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            probe.connect(DOCUMENTATION_ADDRESS)
        except OSError:
            return socket.gethostname()
        return str(probe.getsockname()[0])


def is_address(name: str) -> bool:
    """Tell whether a name is an IP address, which no hostile name server can redirect."""
    try:
        ipaddress.ip_address(name)
    except ValueError:
        return False
    return True


def is_loopback(host: str) -> bool:
    """Tell whether an address is reachable from this machine only."""
    return host.lower() == "localhost" or (
        is_address(host) and ipaddress.ip_address(host).is_loopback
    )


def _listen_error(host: str, port: int, remedy: str, error: OSError | UnicodeError) -> str:
    if getattr(error, "errno", None) == errno.EADDRINUSE:
        return (
            f"port {port} on {host} is in use, perhaps by another viewer; choose another with "
            f"{remedy}"
        )
    if getattr(error, "errno", None) == errno.EACCES:
        return f"port {port} on {host} is not permitted; allowed: 1024 or above, with {remedy}"
    reason = getattr(error, "strerror", None) or error
    return f"host = {host!r} is not possible: {reason}; allowed: an address of this machine"
