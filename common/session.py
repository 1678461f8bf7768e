"""The only place that builds a Zenoh configuration and opens a session.

Client mode through one router; no scouting; no shared memory (its implicit use leaks locked
memory in the router, zenoh #2787); a lease of 2 s, so that a node which froze or lost its
network is known to be gone; retries of 50 to 200 ms, so that flows are back within a second
of the router's return.
"""

from __future__ import annotations

import json
import re
import threading
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import zenoh

from common.errors import ConfigurationError, RouterUnreachable, ToldToStop

DEFAULT_ENDPOINT = "tcp/127.0.0.1:7447"
LEASE_MS = 2000
RETRY = {"period_init_ms": 50, "period_max_ms": 200, "period_increase_factor": 2}
WAIT_BEFORE_CLOSE = "transport/link/tx/queue/congestion_control/block/wait_before_close"
WAIT_BEFORE_CLOSE_US = 1_000_000
"""How long the router waits for a client that reads nothing. With Zenoh's 5 s it outlives the
lease, and closing that client's link then holds up everybody's frames until the wait is over."""

POLL_S = 0.1
CLOSE_S = 1.0
OPEN_TIMEOUT_MS = 800
MIN_TIMEOUT_MS = 20


@dataclass(frozen=True, slots=True)
class Connection:
    """Where a node or tool finds its router.

    Attributes:
        connect: Zenoh endpoint, ``tcp/HOST:PORT``.
        namespace: First chunk of every key expression.
        zenoh_config: JSON5 file that the session starts from, for TLS and the like.
        timeout_s: Give up after so long without a router; None waits for ever.
    """

    connect: str = DEFAULT_ENDPOINT
    namespace: str = "vision"
    zenoh_config: str | None = None
    timeout_s: float | None = None


def client_config(connection: Connection) -> zenoh.Config:
    """Return the configuration of a node's session.

    Raises:
        ConfigurationError: The file cannot be read or holds what Zenoh does not know, or the
            endpoint is malformed.
    """
    config = _base(connection.zenoh_config, "client")
    unless_stated = {
        "connect/endpoints": [connection.connect],
        "connect/retry": RETRY,
        "transport/link/tx/lease": LEASE_MS,
    }
    _insert(config, _not_stated(config, unless_stated, "client"))
    return config


def router_config(listen: str, zenoh_config: str | None = None) -> zenoh.Config:
    """Return the configuration of the embedded router.

    Args:
        listen: Zenoh endpoint, unless the file states where to listen.
        zenoh_config: JSON5 file to start from.

    Raises:
        ConfigurationError: As for ``client_config``.
    """
    config = _base(zenoh_config, "router")
    _insert(config, {"adminspace/enabled": True})
    unless_stated = {
        "listen/endpoints": [listen],
        "connect/retry": RETRY,
        "scouting/delay": 0,
        WAIT_BEFORE_CLOSE: WAIT_BEFORE_CLOSE_US,
    }
    _insert(config, _not_stated(config, unless_stated, "router"))
    return config


def listened_on(config: zenoh.Config) -> list[str]:
    """Return the endpoints that a router with this configuration listens on."""
    return _value(config, "listen/endpoints", "router") or []


def connected_to(config: zenoh.Config) -> list[str]:
    """Return the endpoints at which a node with this configuration looks for its router."""
    return _value(config, "connect/endpoints", "client") or []


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
    while True:
        opened: list[zenoh.Session] = []
        config = client_config(connection)
        left_ms = min(OPEN_TIMEOUT_MS, (give_up_s - time.monotonic()) * 1000)
        _insert(config, {"connect/timeout_ms": max(MIN_TIMEOUT_MS, int(left_ms))})
        attempt = threading.Thread(target=_try_open, args=(config, opened, failed), daemon=True)
        attempt.start()
        while attempt.is_alive():
            attempt.join(POLL_S)
            if stopping() or time.monotonic() > give_up_s + POLL_S:
                attempt.join(OPEN_TIMEOUT_MS / 1000 + POLL_S if stopping() else POLL_S)
                break
        if opened:
            return opened[0]
        if stopping():
            raise ToldToStop("told to stop before a router was there")
        if time.monotonic() >= give_up_s - MIN_TIMEOUT_MS / 1000:
            where = " or ".join(connected_to(config))
            because = f" ({failed[-1]})" if failed else ""
            raise RouterUnreachable(
                f"no Zenoh router at {where} within {connection.timeout_s:g} s"
                f"{because}; start one with `zv router`, "
                "or name another with --connect tcp/HOST:PORT"
            )


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


def plain(error: zenoh.ZError) -> str:
    """Return what Zenoh said, without the places in its source code."""
    return re.sub(r" at \S+\.rs:\d+\.?", "", str(error)).strip()


def _base(path: str | None, mode: str) -> zenoh.Config:
    """Start from a file or from nothing; nothing is searched for unless the file says so."""
    if path is None:
        config = zenoh.Config()
    else:
        if not Path(path).is_file():
            raise ConfigurationError(f"--zenoh-config {path}: no such file")
        try:
            config = zenoh.Config.from_file(path)
        except zenoh.ZError as error:
            raise ConfigurationError(f"--zenoh-config {path}: {plain(error)}") from None
    _insert(config, {"mode": mode, "transport/shared_memory/enabled": False})
    scouting = {"scouting/multicast/enabled": False, "scouting/gossip/enabled": False}
    _insert(config, _not_stated(config, scouting, mode))
    return config


def _not_stated(
    config: zenoh.Config, settings: Mapping[str, object], mode: str
) -> dict[str, object]:
    """Return those settings of which the file that the configuration came from says nothing.

    Zenoh fills in its defaults on reading: what equals them was not stated.
    """
    untouched = zenoh.Config()
    return {
        key: value
        for key, value in settings.items()
        if config.get_json(key) == untouched.get_json(key) or _value(config, key, mode) is None
    }


def _value(config: zenoh.Config, key: str, mode: str) -> Any:
    """Return a setting, of those that can differ by mode the one of this mode."""
    value = json.loads(config.get_json(key))
    if isinstance(value, dict) and value and value.keys() <= {"router", "peer", "client"}:
        return value.get(mode)
    return value


def _insert(config: zenoh.Config, settings: Mapping[str, object]) -> None:
    for key, value in settings.items():
        try:
            config.insert_json5(key, json.dumps(value))
        except zenoh.ZError as error:
            raise ConfigurationError(
                f"zenoh does not accept {key} = {value!r}: {plain(error)}"
            ) from None
