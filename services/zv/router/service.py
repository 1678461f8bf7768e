"""The embedded router: a Zenoh session in router mode, alone in its process."""

from __future__ import annotations

import errno
import logging
import os
import time
from typing import NoReturn

import zenoh

from zenoh_vision.errors import ConfigurationError
from zenoh_vision.host.allocator import use_one_arena
from zenoh_vision.host.health_file import HealthFile
from zenoh_vision.host.signals import StopSignals
from zenoh_vision.transport.router import ask, listening_endpoints
from zenoh_vision.transport.zenoh_config import (
    ROUTER_RUNTIME,
    RUNTIME,
    listen_endpoints,
    router_config,
    zenoh_error_text,
)
from zv.router.settings import RouterSettings
from zv.router.watchdog import HUNG_S, Watchdog

log = logging.getLogger("router")
POLL_S = 0.1
HUNG_STATUS = 1


def run(settings: RouterSettings, zenoh_config: str | None = None) -> None:
    """Route until SIGINT or SIGTERM.

    A router that has locked up ends its process with status 1, so that it is started again.

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
    use_one_arena()
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
        listening = listening_endpoints(session, endpoints)
        log.info("router listens on %s", ", ".join(listening) or "nothing")
        health_file = HealthFile()
        watchdog = Watchdog(lambda: ask(session))
        while not stopping:
            health_file.beat()
            if watchdog.hangs():
                log.error("Zenoh has locked up: no answer for %g s; ends, to be restarted", HUNG_S)
                _exit_at_once(HUNG_STATUS)
            time.sleep(POLL_S)
        if not watchdog.end():
            _exit_at_once(0)


def _exit_at_once(status: int) -> NoReturn:
    """End the process without closing a session that has locked up, which would not end either."""
    logging.shutdown()
    os._exit(status)


def cannot_listen(setting: str, reason: str) -> str:
    """Return the error text for a setting (name and value) that Zenoh refused for a reason."""
    if f"os error {errno.EADDRINUSE}" in reason:
        return (
            f"{setting}: the port is in use, perhaps by a running router. "
            "Use that one with --connect, or another port with --listen tcp/127.0.0.1:PORT"
        )
    return f"{setting} is not possible: {reason}; allowed: tcp/ADDRESS:PORT"
