"""Finds out why no router answers, by a connection and a greeting of its own.

Zenoh only says that it is unable to connect. Whoever reads that starts a second router, although
the first one runs behind a congested link, or speaks another version of the protocol.
"""

from __future__ import annotations

import os
import socket
import threading
import time
from typing import Final

from zenoh_vision.errors import ConnectionFault, RouterUnreachable
from zenoh_vision.transport.endpoints import TcpEndpoint, tcp_endpoint

PROTOCOL: Final = 9
"""Version of Zenoh's protocol, of Zenoh 1.x."""

SLOW_S: Final = 0.5
"""Our sessions give up a handshake after less than this many seconds a round trip."""

GRACE_S: Final = 0.3
START: Final = "start one with `zv router`, or name another with --connect tcp/HOST:PORT"
START_TLS: Final = (
    "start it with `zv router --credentials DIR/router`, or name another with "
    "--connect tls/HOST:PORT"
)
LOADED: Final = (
    "the link is congested or slow: send less over it (zv camera --max-kbps, zv relay), or wait "
    "longer with --timeout 20s"
)
UNKNOWN: Final = "is not known here"
NO_HANDSHAKE: Final = (
    ": its port is open, but no connection by TLS was made: the router hangs, the link is slow or "
    "congested, or programs whose certificates it refuses keep it busy (zenoh #2685)"
)


class Diagnosis:
    """Examines the endpoints of a router on a thread of its own, which nobody waits for.

    Args:
        endpoints: Zenoh's, of which the first over TCP is examined.
        for_s: How long to wait for an answer.
    """

    def __init__(self, endpoints: list[str], for_s: float) -> None:
        self._found = ""
        self._endpoint = next(filter(None, map(tcp_endpoint, endpoints)), None)
        self._for_s = for_s
        self._thread = threading.Thread(target=self._examine, name="diagnosis", daemon=True)
        if self._endpoint is not None and self._endpoint.scheme in ("tcp", "tls"):
            self._thread.start()

    @property
    def text(self) -> str:
        """What was found and what to do about it; that there is none if nothing else is known."""
        if self._thread.ident is not None:
            self._thread.join(GRACE_S)
        is_tls = self._endpoint is not None and self._endpoint.scheme == "tls"
        return self._found or f"; {START_TLS if is_tls else START}"

    @property
    def error(self) -> type[RouterUnreachable]:
        """The error to raise: whether waiting may help, or only another configuration."""
        return ConnectionFault if UNKNOWN in self._found else RouterUnreachable

    def _examine(self) -> None:
        assert self._endpoint is not None
        self._found = examined(self._endpoint, self._for_s)


def examined(endpoint: TcpEndpoint, for_s: float) -> str:
    """Return why a router at an endpoint is not reached, in words that follow its address.

    Empty if nothing listens there. Of TLS, ``handshake`` tells more if the router refuses it.
    """
    began_s = time.monotonic()
    host = endpoint.address
    try:
        with socket.create_connection((host, endpoint.port), for_s) as link:
            if endpoint.scheme == "tls":
                return NO_HANDSHAKE
            link.settimeout(max(0.1, for_s - (time.monotonic() - began_s)))
            link.sendall(greeting())
            answer = link.recv(64)
    except ConnectionRefusedError:
        return ""
    except socket.gaierror:
        return f": the name {host} {UNKNOWN}; check its spelling, and the name server"
    except TimeoutError:
        return (
            f": it does not answer within {for_s:.0f} s: the machine is off or a firewall drops "
            f"what is sent to port {endpoint.port}, or the router hangs, or {LOADED}"
        )
    except ConnectionError:
        answer = b""
    except OSError as error:
        return f" ({error.strerror or error}); {START}"
    took_s = time.monotonic() - began_s
    if is_acknowledgement(answer):
        if took_s < SLOW_S:
            return f"; {START}"
        return f", but it answers after {took_s:.1f} s; {LOADED}"
    if is_refusal(answer):
        return (
            ": the router there speaks another version of Zenoh's protocol; install Zenoh 1.x of "
            "the same minor version on both sides"
        )
    return ": what listens there is no Zenoh router; name another with --connect tcp/HOST:PORT"


def greeting(version: int = PROTOCOL) -> bytes:
    """Return the first message of a Zenoh client over TCP, ``InitSyn``, with its length."""
    identity = os.urandom(16)
    message = bytes([0x01, version, (len(identity) - 1) << 4 | 0x02]) + identity
    return len(message).to_bytes(2, "little") + message


def is_acknowledgement(answer: bytes) -> bool:
    """Tell whether an answer is Zenoh's ``InitAck``: with flag A, of our version."""
    return len(answer) > 3 and answer[2] & 0x3F == 0x21 and answer[3] == PROTOCOL


def is_refusal(answer: bytes) -> bool:
    """Tell whether an answer is of Zenoh, but refuses: ``Close``, or another version."""
    is_whole = len(answer) > 3 and len(answer) - 2 == int.from_bytes(answer[:2], "little")
    return is_whole and answer[2] & 0x1F in (0x01, 0x03)
