"""Opening and closing a session.

A session is waited for as long as its connection allows; an attempt to connect that is not
answered ends after 0.3 s, so that flows are back within a second of the router's return.
"""

from __future__ import annotations

import itertools
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import zenoh

from common.connection import Connection
from common.errors import RouterUnreachable, ToldToStop
from common.reach import round_trip_s
from common.zenoh_config import client_config, connected_to, insert, not_stated, plain

POLL_S = 0.1
CLOSE_S = 1.0
MIN_TIMEOUT_MS = 20
HANDSHAKE = "transport/unicast/open_timeout"


@dataclass(frozen=True, slots=True)
class Patience:
    """How long a session is tried to be opened, and each attempt of Zenoh's within that.

    A router in a container is away with its address: the packet that asks for a connection is
    lost, and TCP sends the next one a second later. Zenoh's own 10 s would wait for that one.
    """

    open_ms: int
    handshake_ms: int


BRISK = Patience(open_ms=800, handshake_ms=300)
PATIENT = Patience(open_ms=1500, handshake_ms=1500)
"""For links with round trips of more than 0.1 s; three of them open a session over TCP."""

PATIENT_EVERY = 4
ANOTHER_MS = 700
ROUND_TRIPS = 5  # with TLS; three without


def direct(callback: Callable[[Any], None]) -> Any:
    """Return a handler that runs on Zenoh's own thread, without the queue of 256 in between.

    What it calls must be quick. (The binding's types know plain callables only.)
    """
    return zenoh.handlers.Callback(callback, indirect=False)


def open_session(
    connection: Connection, stopping: Callable[[], bool] = lambda: False
) -> zenoh.Session:
    """Open a client session, waiting for the router as long as the connection allows.

    ``zenoh.open`` ignores signals while it waits, so it runs in a thread of its own and is
    asked again until a router is there.

    Raises:
        RouterUnreachable: No router within ``timeout_s``.
        ToldToStop: Told to stop before there was one.
        ConfigurationError: As for ``client_config``.
    """
    failed: list[str] = []
    give_up_s = time.monotonic() + (connection.timeout_s or float("inf"))
    for attempt in itertools.count(1):
        patience = BRISK if attempt % PATIENT_EVERY else PATIENT
        session = _attempt(connection, patience, give_up_s, stopping, failed)
        if session is not None and patience is PATIENT:
            session = _brisker(connection, session, give_up_s, stopping)
        if session is not None:
            return session
        if stopping():
            raise ToldToStop("told to stop before a router was there")
        if time.monotonic() >= give_up_s - MIN_TIMEOUT_MS / 1000:
            break
    where = " or ".join(connected_to(client_config(connection)))
    because = f" ({failed[-1]})" if failed else ""
    raise RouterUnreachable(
        f"no Zenoh router at {where} within {connection.timeout_s:g} s"
        f"{because}; start one with `zv router`, "
        "or name another with --connect tcp/HOST:PORT"
    )


def open_another(
    connection: Connection, stopping: Callable[[], bool] = lambda: False
) -> zenoh.Session | None:
    """Try once to open a session, also over a link that has got too slow for the brisk way.

    Who is to stop waits for the attempt, so it is made only where something answers, and is
    given no more time than the way there makes likely.

    Returns:
        None if there is no router.
    """
    way_s = round_trip_s(connected_to(client_config(connection)), PATIENT.open_ms / 1000, stopping)
    if way_s is None or stopping():
        return None
    enough_ms = min(PATIENT.open_ms, ANOTHER_MS + int(ROUND_TRIPS * way_s * 1000))
    return _attempt(connection, Patience(enough_ms, enough_ms), float("inf"), stopping, [])


def _brisker(
    connection: Connection,
    patient: zenoh.Session,
    give_up_s: float,
    stopping: Callable[[], bool],
) -> zenoh.Session:
    """Return a session that reconnects sooner, where the link allows one."""
    brisk = _attempt(connection, BRISK, give_up_s, stopping, [])
    if brisk is None:
        return patient
    close_session(patient)
    return brisk


def _attempt(
    connection: Connection,
    patience: Patience,
    give_up_s: float,
    stopping: Callable[[], bool],
    failed: list[str],
) -> zenoh.Session | None:
    """Try once to open a session; why not is added to ``failed``."""
    opened: list[zenoh.Session] = []
    config = client_config(connection)
    left_ms = min(patience.open_ms, (give_up_s - time.monotonic()) * 1000)
    insert(config, {"connect/timeout_ms": max(MIN_TIMEOUT_MS, int(left_ms))})
    insert(config, not_stated(config, {HANDSHAKE: patience.handshake_ms}, "client"))
    attempt = threading.Thread(target=_try_open, args=(config, opened, failed), daemon=True)
    attempt.start()
    while attempt.is_alive():
        attempt.join(POLL_S)
        if stopping() or time.monotonic() > give_up_s + POLL_S:
            attempt.join(patience.open_ms / 1000 + POLL_S if stopping() else POLL_S)
            break
    return opened[0] if opened else None


def close_session(session: zenoh.Session) -> None:
    """Close a session in bounded time, whatever the router does."""
    closing = threading.Thread(target=session.close, daemon=True)
    closing.start()
    closing.join(CLOSE_S)


def _try_open(config: zenoh.Config, opened: list[zenoh.Session], failed: list[str]) -> None:
    try:
        opened.append(zenoh.open(config))
    except zenoh.ZError as error:
        failed.append(plain(error))
