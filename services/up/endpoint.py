"""Where the router listens: found free before anything starts, and how its nodes reach it."""

from __future__ import annotations

import errno
import re
import socket

from common.errors import ConfigurationError

TCP = re.compile(r"(?P<scheme>tcp|tls|ws)/(?P<host>.+):(?P<port>\d{1,5})(?P<rest>[?#].*)?")
MAX_PORT = 65535
ANY_ADDRESS = {"0.0.0.0": "127.0.0.1", "[::]": "[::1]"}  # noqa: S104 - compared, not bound


def free(listen: str) -> str:
    """Return an endpoint that can be listened on, with a port of its own if it asked for 0.

    The nodes start together with the router. If another router had the port, they would be at
    home there before ours could say so; therefore the port is tried first.

    Args:
        listen: Zenoh endpoint; one that is not over TCP is for the router itself to judge.

    Raises:
        ConfigurationError: It cannot be listened on; says why and the way out.
    """
    found = TCP.fullmatch(listen)
    if found is None:
        return listen
    host, port = found["host"], int(found["port"])
    try:
        if port > MAX_PORT:  # getaddrinfo would take the remainder
            raise OverflowError(f"there is no port {port}")
        families = socket.getaddrinfo(host.strip("[]"), port, type=socket.SOCK_STREAM)
        family, _, _, _, address = families[0]
        with socket.socket(family, socket.SOCK_STREAM) as probe:
            # As the router does: connections of an earlier one that fade out are no obstacle.
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            probe.bind(address)
            port = probe.getsockname()[1]
    except (OSError, OverflowError) as error:
        raise ConfigurationError(_why_not(listen, error)) from None
    return f"{found['scheme']}/{host}:{port}{found['rest'] or ''}"


def stated(path: str, endpoints: list[str]) -> str:
    """Return the first of the endpoints that the router's own file states.

    Args:
        path: That file, which says where to listen instead of the flag.
        endpoints: What it states.

    Raises:
        ConfigurationError: The nodes cannot be told where it is, or it cannot be listened on.
    """
    if not endpoints or free(endpoints[0]) != endpoints[0]:
        raise ConfigurationError(
            f"{path}: listen/endpoints = {endpoints} is not allowed here, the nodes would not "
            "find the router; allowed: tcp/ADDRESS:PORT, or no listen/endpoints at all: then "
            "listen of the launch file or --listen says it"
        )
    return endpoints[0]


def reach(listen: str) -> str:
    """Return where a node on this machine finds a router that listens there."""
    found = TCP.fullmatch(listen)
    if found is None:
        return re.split("[?#]", listen)[0]
    host = ANY_ADDRESS.get(found["host"], found["host"])
    return f"{found['scheme']}/{host}:{found['port']}"


def _why_not(listen: str, error: OSError | OverflowError) -> str:
    if isinstance(error, OSError) and error.errno == errno.EADDRINUSE:
        return (
            f"listen = {listen!r}: the port is taken, perhaps by a router that runs already. "
            f"Use that one with --connect {reach(listen)}, "
            "or listen elsewhere with --listen tcp/127.0.0.1:OTHER_PORT"
        )
    said = getattr(error, "strerror", None) or error
    return f"listen = {listen!r} is not possible: {said}; allowed: tcp/ADDRESS:PORT"
