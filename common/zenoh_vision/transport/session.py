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
from zenoh_vision.transport.endpoints import round_trip_s
from zenoh_vision.transport.zenoh_config import (
    client_config,
    connect_endpoints,
    set_defaults,
    set_values,
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

LONG_EVERY = 4
"""Every fourth attempt has long time-outs."""

UNREACHABLE = "Unable to connect"
"""Begins Zenoh's error for a router that does not answer, which adds nothing to our own."""

REPLACEMENT_BASE_MS = 700
REPLACEMENT_ROUND_TRIPS = 5  # with TLS; three without


def direct(callback: Callable[[Any], None]) -> Any:
    """Return a handler that runs on Zenoh's own thread, without the queue of 256 in between.

    The callback must be quick. (The binding's types know plain callables only.)
    """
    return zenoh.handlers.Callback(callback, indirect=False)


def open_session(
    connection: Connection, stopping: Callable[[], bool] = lambda: False
) -> zenoh.Session:
    """Open a client session, waiting for the router as long as the connection allows.

    ``zenoh.open`` ignores signals, so each attempt runs on a thread of its own.

    Raises:
        RouterUnreachable: No router within ``timeout_s``.
        ToldToStop: Told to stop before there was one.
        ConfigurationError: As for ``client_config``.
    """
    errors: list[str] = []
    deadline_s = time.monotonic() + (connection.timeout_s or float("inf"))
    for attempt in itertools.count(1):
        timeouts = SHORT if attempt % LONG_EVERY else LONG
        session = _attempt(connection, timeouts, deadline_s, stopping, errors)
        if session is not None and timeouts is LONG:
            # A session with short time-outs also reconnects sooner, if the link allows it.
            faster = _attempt(connection, SHORT, deadline_s, stopping, [])
            if faster is not None:
                close_session(session)
                return faster
        if session is not None:
            return session
        if stopping():
            raise ToldToStop("told to stop before a router was there")
        if time.monotonic() >= deadline_s - MIN_TIMEOUT_MS / 1000:
            break
    where = " or ".join(connect_endpoints(client_config(connection)))
    because = f" ({errors[-1]})" if errors and UNREACHABLE not in errors[-1] else ""
    raise RouterUnreachable(
        f"no Zenoh router at {where} within {connection.timeout_s:g} s{because}; "
        "start one with `zv router`, or name another with --connect tcp/HOST:PORT"
    )


def open_replacement(
    connection: Connection, stopping: Callable[[], bool] = lambda: False
) -> zenoh.Session | None:
    """Try once to open a session, also over a link that has become too slow for short time-outs.

    An interpreter that ends waits for this attempt. So it is made only if an endpoint answers, with
    a time-out that depends on the round trip. Return None if there is no router.
    """
    endpoints = connect_endpoints(client_config(connection))
    trip_s = round_trip_s(endpoints, LONG.open_ms / 1000, stopping)
    if trip_s is None or stopping():
        return None
    enough_ms = REPLACEMENT_BASE_MS + int(REPLACEMENT_ROUND_TRIPS * trip_s * 1000)
    timeout_ms = min(LONG.open_ms, enough_ms)
    return _attempt(connection, Timeouts(timeout_ms, timeout_ms), float("inf"), stopping, [])


def open_at_once(connection: Connection, timeout_s: float) -> zenoh.Session | None:
    """Open a session if a router answers within a time; return None if none does.

    The interpreter must not end during the attempt, which would abort the process.
    """
    if round_trip_s(connect_endpoints(client_config(connection)), timeout_s) is None:
        return None
    timeout_ms = max(MIN_TIMEOUT_MS, int(timeout_s * 1000))
    timeouts = Timeouts(timeout_ms, timeout_ms)
    return _attempt(connection, timeouts, time.monotonic() + timeout_s, lambda: False, [])


def _attempt(
    connection: Connection,
    timeouts: Timeouts,
    deadline_s: float,
    stopping: Callable[[], bool],
    errors: list[str],
) -> zenoh.Session | None:
    """Try once to open a session; the text of an error is added to ``errors``."""
    opened: list[zenoh.Session] = []
    config = client_config(connection)
    left_ms = min(timeouts.open_ms, (deadline_s - time.monotonic()) * 1000)
    set_values(config, {"connect/timeout_ms": max(MIN_TIMEOUT_MS, int(left_ms))})
    set_defaults(config, {"transport/unicast/open_timeout": timeouts.handshake_ms}, "client")

    def connect() -> None:
        try:
            opened.append(zenoh.open(config))
        except zenoh.ZError as error:
            errors.append(zenoh_error_text(error))

    # Not a daemon: an interpreter that ends while Zenoh opens a session aborts, so it waits.
    thread = threading.Thread(target=connect, name="connect")
    thread.start()
    while thread.is_alive():
        thread.join(POLL_S)
        if stopping() or time.monotonic() > deadline_s + POLL_S:
            abandon(thread)  # ``zv`` and ``run_service`` end without waiting for it
            break
    return opened[0] if opened else None


def close_session(session: zenoh.Session) -> None:
    """Close a session in bounded time, whatever the router does."""
    closing = threading.Thread(target=session.close, daemon=True)
    closing.start()
    closing.join(CLOSE_TIMEOUT_S)
