"""Opens and closes sessions in bounded time; the package's docstring explains the time-outs."""

from __future__ import annotations

import itertools
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import zenoh

from zenoh_vision.errors import RouterUnreachable, ToldToStop
from zenoh_vision.host.abandoned_threads import abandon
from zenoh_vision.transport.connection import Connection
from zenoh_vision.transport.handshake import refusal
from zenoh_vision.transport.unreachable import START, Diagnosis
from zenoh_vision.transport.zenoh_config import (
    client_config,
    connect_endpoints,
    credentials_of,
    set_defaults,
    set_values,
    where,
    zenoh_error_text,
)

POLL_S = 0.1
CLOSE_TIMEOUT_S = 1.0
MIN_TIMEOUT_MS = 20


@dataclass(frozen=True, slots=True)
class Timeouts:
    """Time-outs of one attempt to open a session, and of each handshake within it."""

    open_ms: int
    handshake_ms: int


SHORT = Timeouts(open_ms=800, handshake_ms=300)
LONG = Timeouts(open_ms=1500, handshake_ms=1500)
"""For links with round trips of more than 0.1 s; three of them open a session over TCP."""

REFUSED_S = 5.0
"""Between attempts while the router refuses the handshake. Each costs it 0.1 s, in which nobody
else gets in (zenoh #2685), so that three nodes that tried all the time would keep everybody out."""

LONG_EVERY = 4
"""Every fourth attempt has long time-outs."""

UNREACHABLE = "Unable to connect"
"""Begins Zenoh's error for a router that does not answer, which adds nothing to our own."""


def direct(callback: Callable[[Any], None]) -> Any:
    """Return a handler that runs on Zenoh's own thread, without the queue of 256 in between.

    The callback must be quick. (The binding's types know plain callables only.)
    """
    return zenoh.handlers.Callback(callback, indirect=False)


def open_session(
    connection: Connection,
    stopping: Callable[[], bool] = lambda: False,
    refused: Callable[[], bool] = lambda: False,
) -> zenoh.Session:
    """Open a client session, waiting for the router as long as the connection allows.

    ``zenoh.open`` ignores signals, so each attempt runs on a thread of its own.

    Args:
        connection: Where the router is, and how long to wait.
        stopping: Polled; ends the wait.
        refused: Whether the router refuses the handshake; the next attempt waits while it does.

    Raises:
        RouterUnreachable: No router within ``timeout_s``.
        ConnectionFault: None either, since the name in the endpoint is not known.
        ToldToStop: Told to stop before there was one.
        ConfigurationError: As for ``client_config``.
    """
    errors: list[str] = []
    diagnosis: Diagnosis | None = None
    limit_s = float("inf") if connection.timeout_s is None else connection.timeout_s
    deadline_s = time.monotonic() + limit_s
    for attempt in itertools.count(1):
        timeouts = SHORT if attempt % LONG_EVERY else LONG
        session = try_session(connection, stopping, timeouts, deadline_s, errors)
        if session is not None:
            return session
        if diagnosis is None and connection.timeout_s is not None:
            endpoints = connect_endpoints(client_config(connection))
            diagnosis = Diagnosis(endpoints, max(0.1, deadline_s - time.monotonic()))
        again_s = min(deadline_s, time.monotonic() + REFUSED_S)
        while refused() and time.monotonic() < again_s and not stopping():
            time.sleep(POLL_S)
        if stopping():
            raise ToldToStop("told to stop before a router was there")
        if time.monotonic() >= deadline_s - MIN_TIMEOUT_MS / 1000:
            break
    because = f" ({errors[-1]})" if errors and UNREACHABLE not in errors[-1] else ""
    why = diagnosis.text if diagnosis is not None else f"; {START}"
    kind = diagnosis.error if diagnosis is not None else RouterUnreachable
    raise kind(
        f"no Zenoh router at {where(connection)} within {connection.timeout_s:g} s{because}{why}"
    )


def why_refused(connection: Connection) -> str:
    """Return why the router refuses this connection; empty if it does not, or is not there.

    Raises:
        VisionError: As for ``client_config``.
    """
    endpoints = connect_endpoints(client_config(connection))
    return refusal(endpoints, credentials_of(connection))


def try_session(
    connection: Connection,
    stopping: Callable[[], bool],
    timeouts: Timeouts = LONG,
    deadline_s: float = float("inf"),
    errors: list[str] | None = None,
) -> zenoh.Session | None:
    """Try once to open a session; None if there is no router, or if told to stop.

    The wait also ends at ``deadline_s``, a monotonic time. The time-outs are by default those for a
    link that may have become slow. ``errors`` gets the text of an error.
    """
    opened: list[zenoh.Session] = []
    config = client_config(connection)
    left_ms = min(timeouts.open_ms, (deadline_s - time.monotonic()) * 1000)
    set_values(config, {"connect/timeout_ms": max(MIN_TIMEOUT_MS, int(left_ms))})
    set_defaults(config, {"transport/unicast/open_timeout": timeouts.handshake_ms}, "client")

    def connect() -> None:
        try:
            opened.append(zenoh.open(config))
        except zenoh.ZError as error:
            if errors is not None:
                errors.append(zenoh_error_text(error))

    # Not a daemon: an interpreter that ends while Zenoh opens a session aborts, so it waits.
    thread = threading.Thread(target=connect, name="connect")
    thread.start()
    while thread.is_alive():
        thread.join(POLL_S)
        if stopping() or time.monotonic() > deadline_s + POLL_S:
            abandon(thread)  # ``zv`` and ``run_service`` end without waiting for it
            break
    if not opened or timeouts is SHORT:
        return opened[0] if opened else None
    # A session with short time-outs also reconnects sooner, if the link allows it.
    faster = try_session(connection, stopping, SHORT, deadline_s)
    if faster is None:
        return opened[0]
    close_session(opened[0])
    return faster


def close_session(session: zenoh.Session) -> None:
    """Close a session in bounded time, whatever the router does."""
    closing = threading.Thread(target=session.close, daemon=True)
    closing.start()
    closing.join(CLOSE_TIMEOUT_S)
    abandon(closing)  # an interpreter that ends while Zenoh closes a session crashes
