"""The only place that builds a Zenoh configuration.

Client mode through one router; no scouting; no shared memory (its implicit use leaks locked
memory in the router, zenoh #2787); a lease of 2 s, so that a node which froze or lost its
network is known to be gone; retries of 50 to 200 ms, so that flows are back within a second
of the router's return.
"""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import zenoh

from common.connection import Connection
from common.errors import ConfigurationError

LEASE_MS = 2000
RETRY = {"period_init_ms": 50, "period_max_ms": 200, "period_increase_factor": 2}
WAIT_BEFORE_CLOSE = "transport/link/tx/queue/congestion_control/block/wait_before_close"
WAIT_BEFORE_CLOSE_US = 1_000_000
"""How long the router waits for a client that reads nothing. With Zenoh's 5 s it outlives the
lease, and closing that client's link then holds up everybody's frames until the wait is over."""


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
    insert(config, not_stated(config, unless_stated, "client"))
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
    insert(config, {"adminspace/enabled": True})
    unless_stated = {
        "listen/endpoints": [listen],
        "connect/retry": RETRY,
        "scouting/delay": 0,
        WAIT_BEFORE_CLOSE: WAIT_BEFORE_CLOSE_US,
    }
    insert(config, not_stated(config, unless_stated, "router"))
    return config


def listened_on(config: zenoh.Config) -> list[str]:
    """Return the endpoints that a router with this configuration listens on."""
    return _value(config, "listen/endpoints", "router") or []


def connected_to(config: zenoh.Config) -> list[str]:
    """Return the endpoints at which a node with this configuration looks for its router."""
    return _value(config, "connect/endpoints", "client") or []


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
    insert(config, {"mode": mode, "transport/shared_memory/enabled": False})
    scouting = {"scouting/multicast/enabled": False, "scouting/gossip/enabled": False}
    insert(config, not_stated(config, scouting, mode))
    return config


def not_stated(
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


def insert(config: zenoh.Config, settings: Mapping[str, object]) -> None:
    """Set what a configuration is to have.

    Raises:
        ConfigurationError: Zenoh does not accept it.
    """
    for key, value in settings.items():
        try:
            config.insert_json5(key, json.dumps(value))
        except zenoh.ZError as error:
            raise ConfigurationError(
                f"zenoh does not accept {key} = {value!r}: {plain(error)}"
            ) from None
