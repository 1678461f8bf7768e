"""Zenoh endpoints such as ``tcp/10.0.0.5:7447``, and their parts."""

from __future__ import annotations

import re
from dataclasses import dataclass

from zenoh_vision.error_text import did_you_mean

MAX_PORT = 65535

PROTOCOLS = ("tcp", "tls", "udp", "quic", "ws", "unixsock-stream")
WITH_PORT = PROTOCOLS[:-1]
FORM = (
    "PROTOCOL/HOST:PORT such as tcp/192.168.0.2:7447, or unixsock-stream/PATH; PROTOCOL: "
    + ", ".join(WITH_PORT)
)
HOST_AND_PORT = re.compile(r"([^:\[\]/?#\s]+|\[[^\[\]\s]+\]):([0-9]{1,5})([?#].*)?")
HOST = re.compile(r"[^:\[\]/?#\s]+|\[[^\[\]\s]+\]")

OVER_TCP = re.compile(r"(tcp|tls|ws|wss)/([^?#]+):(\d{1,5})([?#].*)?")
ANY_ADDRESS = {"0.0.0.0": "127.0.0.1", "[::]": "[::1]"}  # noqa: S104 - compared, not bound


def checked_endpoint(text: str) -> str:
    """Return an endpoint unchanged.

    Raises:
        ValueError: Zenoh could not use it; says what is wrong. Zenoh itself would try for ever.
    """
    protocol, _, rest = text.partition("/")
    if protocol not in PROTOCOLS:
        hint = did_you_mean([f"tcp/{text}"] if HOST_AND_PORT.fullmatch(text) else [], before="; ")
        raise ValueError(f"it begins with none of the protocols{hint}")
    if not rest:
        raise ValueError(f"nothing follows {protocol}/")
    if protocol in WITH_PORT:
        found = HOST_AND_PORT.fullmatch(rest)
        if found is None:
            if HOST.fullmatch(rest) is None:
                raise ValueError("it is not one host and one port; IPv6 is written [::1]:7447")
            raise ValueError(f"it has no port{did_you_mean([f'{text}:7447'], before='; ')}")
        if int(found[2]) > MAX_PORT:
            raise ValueError(f"ports end at {MAX_PORT}")
        if not all(0 < len(part) < 64 for part in found[1].removesuffix(".").split(".")):
            raise ValueError("its host cannot be looked up: a part is empty or too long")
    return text


@dataclass(frozen=True, slots=True)
class TcpEndpoint:
    """The parts of an endpoint over TCP.

    Attributes:
        host: Name or address; IPv6 in brackets.
        port: As written; it may exceed the highest valid port.
        rest: Metadata and configuration of Zenoh, with ``?`` or ``#`` in front.
    """

    scheme: str
    host: str
    port: int
    rest: str = ""

    def __str__(self) -> str:
        return f"{self.scheme}/{self.host}:{self.port}{self.rest}"

    @property
    def address(self) -> str:
        """The host as the system's resolver takes it."""
        return self.host.strip("[]")


def tcp_endpoint(text: str) -> TcpEndpoint | None:
    """Return the parts of an endpoint; None if it is not over TCP."""
    found = OVER_TCP.fullmatch(text)
    if found is None:
        return None
    return TcpEndpoint(found[1], found[2], int(found[3]), found[4] or "")


def local_endpoint(listen: str) -> str:
    """Return the endpoint at which this machine reaches a router that listens on an endpoint."""
    found = tcp_endpoint(listen)
    if found is None:
        return re.split("[?#]", listen)[0]
    host = ANY_ADDRESS.get(found.host, found.host)
    return str(TcpEndpoint(found.scheme, host, found.port))
