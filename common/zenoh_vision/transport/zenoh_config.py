"""Builds all Zenoh configurations; the package's docstring has the reasons."""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import zenoh

from zenoh_vision.error_text import shortened
from zenoh_vision.errors import ConfigurationError, SourceError
from zenoh_vision.security.credentials import Credentials, read_credentials
from zenoh_vision.transport.connection import DEFAULT_ENDPOINT, Connection
from zenoh_vision.transport.endpoints import FORM, PROTOCOLS, checked_endpoint

LEASE_MS = 2000
RETRY = {"period_init_ms": 50, "period_max_ms": 200, "period_increase_factor": 2}
WAIT_BEFORE_CLOSE = "transport/link/tx/queue/congestion_control/block/wait_before_close"
WAIT_BEFORE_CLOSE_US = 1_000_000
"""How long the router waits for a client that reads nothing. Zenoh's 5 s outlive the lease, and
closing that client's link then blocks all other clients until the wait is over."""

MESSAGE_QUEUE = "transport/link/tx/queue/size/interactive_high"
MESSAGE_BATCHES = 16
"""Batches of 64 kB of messages that may wait for a client, the most that Zenoh allows. Its default
of 2 holds the messages of 2 s; a frozen client then blocked the streams of all others again and
again."""

SECURE = ("tls", "quic")
"""Protocols that carry certificates."""

RUNTIME = "ZENOH_RUNTIME"
"""Environment variable with the threads of Zenoh; there is no setting for them in its files."""

ROUTER_RUNTIME = "(rx: (worker_threads: 32))"
"""Closing the link of a frozen client blocks a thread for 10 s, since Zenoh sets SO_LINGER (zenoh
#1101). By default the router receives with two threads, so two such clients blocked all others.
Each further thread allows one more."""

MAX_MESSAGE_SIZE = "transport/link/rx/max_message_size"
MAX_MESSAGE_BYTES = 128 << 20
"""For the largest raw frame, 7680 x 4320 pixels of 4 bytes, with its header. Zenoh keeps a message
in memory before anybody can refuse it, so with its own limit of 1 GiB each process could take that
much."""


def client_config(connection: Connection) -> zenoh.Config:
    """Return the configuration of a node's session, with its credentials as they are now.

    Raises:
        SourceError: There is no such file.
        ConfigurationError: It cannot be read or has settings unknown to Zenoh, the endpoint is
            malformed, or the credentials cannot be used.
    """
    credentials = credentials_of(connection)
    endpoint = _endpoint(connection, credentials)
    _check_endpoints("connect", [endpoint])
    config = _base(connection.zenoh_config, "client")
    if credentials is not None:
        set_values(config, {"transport/link/tls": credentials.tls})
    defaults = {
        "connect/endpoints": [endpoint],
        "connect/retry": RETRY,
        "transport/link/tx/lease": LEASE_MS,
        MAX_MESSAGE_SIZE: MAX_MESSAGE_BYTES,
    }
    return _checked(config, defaults, "client", connection.zenoh_config)


def where(connection: Connection) -> str:
    """Return the endpoints to which a node with this connection connects, for people."""
    return " or ".join(connect_endpoints(client_config(connection)))


def credentials_of(connection: Connection) -> Credentials | None:
    """Return the credentials of a connection, if it has some.

    Raises:
        VisionError: As for ``read_credentials``.
    """
    return None if connection.credentials is None else read_credentials(connection.credentials)


def _endpoint(connection: Connection, credentials: Credentials | None) -> str:
    """Return where to connect; the default endpoint gives way to that of the credentials.

    Raises:
        ConfigurationError: The endpoint's protocol carries no certificate.
    """
    if credentials is None:
        return connection.connect
    if connection.connect == DEFAULT_ENDPOINT:
        return credentials.endpoint
    protocol, _, rest = connection.connect.partition("/")
    if protocol in PROTOCOLS and protocol not in SECURE:
        raise ConfigurationError(
            f"connect = {shortened(connection.connect)} is not allowed with credentials, since "
            f"{protocol} carries no certificate; allowed: tls/{rest}, or leave it out for "
            f"{credentials.endpoint}"
        )
    return connection.connect


def router_config(
    listen: str, zenoh_config: str | None = None, text: str | None = None
) -> zenoh.Config:
    """Return the configuration of the embedded router.

    Args:
        listen: Zenoh endpoint, unless the file has others.
        zenoh_config: JSON5 file to start from.
        text: What was read of that file; None to read it.

    Raises:
        ConfigurationError: As for ``client_config``.
    """
    _check_endpoints("listen", [listen])
    config = _base(zenoh_config, "router", text)
    set_values(config, {"adminspace/enabled": True})
    defaults = {
        "listen/endpoints": [listen],
        "connect/retry": RETRY,
        "scouting/delay": 0,
        WAIT_BEFORE_CLOSE: WAIT_BEFORE_CLOSE_US,
        MESSAGE_QUEUE: MESSAGE_BATCHES,
        MAX_MESSAGE_SIZE: MAX_MESSAGE_BYTES,
    }
    return _checked(config, defaults, "router", zenoh_config)


def _checked(
    config: zenoh.Config, defaults: Mapping[str, object], mode: str, path: str | None
) -> zenoh.Config:
    """Set the options that a file does not set, and check the resulting endpoints."""
    set_defaults(config, defaults, mode)
    if path is not None:
        for kind in ("connect", "listen"):
            stated = _value(config, f"{kind}/endpoints", mode) or []
            known = [each for each in stated if each.partition("/")[0] in PROTOCOLS]
            _check_endpoints(f"--zenoh-config {path}: {kind}/endpoints", known)
    return config


def _check_endpoints(place: str, endpoints: Iterable[str]) -> None:
    """Check endpoints before Zenoh gets them, which would try an impossible one for ever.

    Raises:
        ConfigurationError: One cannot be used; names the place and what is allowed.
    """
    for endpoint in endpoints:
        try:
            checked_endpoint(endpoint)
        except ValueError as error:
            raise ConfigurationError(
                f"{place} = {shortened(endpoint)} is not allowed ({error}); allowed: {FORM}"
            ) from None


def listen_endpoints(config: zenoh.Config) -> list[str]:
    """Return the endpoints that a router with this configuration listens on."""
    return _value(config, "listen/endpoints", "router") or []


def connect_endpoints(config: zenoh.Config) -> list[str]:
    """Return the endpoints to which a node with this configuration connects."""
    return _value(config, "connect/endpoints", "client") or []


def zenoh_error_text(error: zenoh.ZError) -> str:
    """Return the text of a Zenoh error, without positions in its source code."""
    return re.sub(r" at \S+\.rs:\d+\.?", "", str(error)).strip()


def _base(path: str | None, mode: str, text: str | None = None) -> zenoh.Config:
    """Return the configuration in a file, or an empty one; no scouting unless the file says so."""
    if path is None:
        config = zenoh.Config()
    else:
        if text is None and not Path(path).is_file():
            raise SourceError(f"--zenoh-config {path}: no such file")
        try:
            config = zenoh.Config.from_file(path) if text is None else zenoh.Config.from_json5(text)
        except zenoh.ZError as error:
            raise ConfigurationError(f"--zenoh-config {path}: {zenoh_error_text(error)}") from None
    # Shared memory: its implicit use leaks locked memory in the router (zenoh #2787).
    set_values(config, {"mode": mode, "transport/shared_memory/enabled": False})
    scouting = {"scouting/multicast/enabled": False, "scouting/gossip/enabled": False}
    return set_defaults(config, scouting, mode)


def set_defaults(config: zenoh.Config, defaults: Mapping[str, object], mode: str) -> zenoh.Config:
    """Set the options that the file from which the configuration came does not; return it.

    Zenoh fills in its own defaults on reading: a value that equals them was not set.

    Raises:
        ConfigurationError: Zenoh does not accept a value.
    """
    untouched = zenoh.Config()
    missing = {
        key: value
        for key, value in defaults.items()
        if config.get_json(key) == untouched.get_json(key) or _value(config, key, mode) is None
    }
    set_values(config, missing)
    return config


def set_values(config: zenoh.Config, values: Mapping[str, object]) -> None:
    """Set options of a configuration.

    Raises:
        ConfigurationError: Zenoh does not accept a value.
    """
    for key, value in values.items():
        try:
            config.insert_json5(key, json.dumps(value))
        except zenoh.ZError as error:
            raise ConfigurationError(
                f"zenoh does not accept {key} = {value!r}: {zenoh_error_text(error)}"
            ) from None


def _value(config: zenoh.Config, key: str, mode: str) -> Any:
    """Return the value of an option; of one that differs by mode, the value for this mode."""
    value = json.loads(config.get_json(key))
    if isinstance(value, dict) and value and value.keys() <= {"router", "peer", "client"}:
        return value.get(mode)
    return value
