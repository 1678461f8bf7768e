"""The embedded router: a Zenoh session in router mode, alone in its process."""

from __future__ import annotations

import errno
import json
import logging
import os
import re
import time

import zenoh

from zenoh_vision.errors import ConfigurationError
from zenoh_vision.host.health_file import HealthFile
from zenoh_vision.host.signals import StopSignals
from zenoh_vision.transport.zenoh_config import (
    ROUTER_RUNTIME,
    RUNTIME,
    listen_endpoints,
    router_config,
    zenoh_error_text,
)
from zv.router.settings import RouterSettings

log = logging.getLogger("router")
POLL_S = 0.1
QUERY_TIMEOUT_S = 2.0
PORT_0 = re.compile(r":0(?=$|[?#])")


def run(settings: RouterSettings, zenoh_config: str | None = None) -> None:
    """Route until SIGINT or SIGTERM.

    Args:
        settings: Where to listen.
        zenoh_config: Zenoh's own JSON5 file; its endpoints take precedence over the settings'.

    Raises:
        ConfigurationError: The router cannot listen on an endpoint; the text says why and what
            to do.
    """
    stopping = False

    def stop() -> None:
        nonlocal stopping
        stopping = True

    StopSignals(stop).catch()
    os.environ.setdefault(RUNTIME, ROUTER_RUNTIME)
    config = router_config(settings.listen, zenoh_config)
    endpoints = listen_endpoints(config)
    try:
        session = zenoh.open(config)
    except zenoh.ZError as error:
        setting = "listen" if zenoh_config is None else f"{zenoh_config}: listen/endpoints"
        value = endpoints[0] if len(endpoints) == 1 else endpoints
        raise ConfigurationError(
            cannot_listen(f"{setting} = {value!r}", zenoh_error_text(error))
        ) from None
    with session:
        if any(PORT_0.search(endpoint) for endpoint in endpoints):
            endpoints = with_ports(endpoints, locators(session))
        log.info("router listens on %s", ", ".join(endpoints) or "nothing")
        health_file = HealthFile()
        while not stopping:
            health_file.beat()
            time.sleep(POLL_S)


def with_ports(endpoints: list[str], addresses: list[str]) -> list[str]:
    """Return the endpoint, with port 0 replaced by the port of the addresses.

    With several endpoints, or addresses with several ports, return the addresses themselves.
    """
    ports = {address.rpartition(":")[2] for address in addresses}
    if len(endpoints) == len(ports) == 1:
        return [PORT_0.sub(f":{ports.pop()}", endpoints[0])]
    return addresses


def locators(session: zenoh.Session) -> list[str]:
    """Return the addresses that a router announces, which are all addresses of this machine."""
    for reply in session.get(f"@/{session.zid()}/router", timeout=QUERY_TIMEOUT_S):
        if reply.ok:
            found: list[str] = json.loads(reply.ok.payload.to_string())["locators"]
            return found
    return []


def cannot_listen(setting: str, reason: str) -> str:
    """Return the error text for a setting (name and value) that Zenoh refused for a reason."""
    if f"os error {errno.EADDRINUSE}" in reason:
        return (
            f"{setting}: the port is in use, perhaps by a running router. "
            "Use that one with --connect, or another port with --listen tcp/127.0.0.1:PORT"
        )
    return f"{setting} is not possible: {reason}; allowed: tcp/ADDRESS:PORT"
