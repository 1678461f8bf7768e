"""The embedded router: a Zenoh session in router mode, alone in its process."""

from __future__ import annotations

import errno
import logging
import os
import time
from functools import partial
from typing import NoReturn

import zenoh

from zenoh_vision.errors import ConfigurationError
from zenoh_vision.host.allocator import use_one_arena
from zenoh_vision.host.health_file import HealthFile
from zenoh_vision.host.signals import StopSignals
from zenoh_vision.security.credentials import renewal_of
from zenoh_vision.transport.router import ask, listening_endpoints
from zenoh_vision.transport.zenoh_config import (
    ROUTER_RUNTIME,
    RUNTIME,
    listen_endpoints,
    router_config,
    zenoh_error_text,
)
from zv.router.rules import RouterRules
from zv.router.settings import RouterSettings
from zv.router.watchdog import HUNG_S, Watchdog

log = logging.getLogger("router")
POLL_S = 0.1
HUNG_STATUS = 1


def run(
    settings: RouterSettings, zenoh_config: str | None = None, credentials: str | None = None
) -> None:
    """Route until SIGINT or SIGTERM.

    A router that has locked up ends its process with status 1, so that it is started again. One
    with credentials takes new ones when their file changes: connections are closed, and those that
    are still allowed come back within a second.

    Args:
        settings: Where to listen.
        zenoh_config: Zenoh's own JSON5 file; its endpoints take precedence over the settings'.
        credentials: The same from ``zv security``, with certificates and access rules.

    Raises:
        ConfigurationError: The router cannot listen on an endpoint, the text says why and what
            to do; or its credentials cannot be used.
        SourceError: There is no such file.
    """
    os.environ.setdefault(RUNTIME, ROUTER_RUNTIME)
    use_one_arena()
    rules = None if credentials is None else RouterRules(credentials, settings.listen)
    path = zenoh_config if rules is None else str(rules.path)
    if rules is not None and zenoh_config is not None:
        raise ConfigurationError("--credentials and --zenoh-config are both given; allowed: one")
    health_file = HealthFile()
    again = False
    with StopSignals() as signals:
        while not signals.stopping:
            config = router_config(settings.listen, path) if rules is None else rules.config
            try:
                opened = _opened(config, path, None if rules is None else renewal_of(rules.path))
            except ConfigurationError as error:
                if rules is None or not rules.reject(error):
                    raise
                continue
            if again and rules is not None and not rules.fault:
                log.warning("took the new rules in %s; all connections were closed", path)
            again = True
            with opened as session:
                watchdog = Watchdog(partial(ask, session))
                while not signals.stopping and not (rules is not None and rules.changed()):
                    health_file.beat("" if rules is None else rules.fault)
                    if watchdog.hangs():
                        log.error(
                            "Zenoh has locked up: no answer for %g s; ends, to be restarted", HUNG_S
                        )
                        _exit_at_once(HUNG_STATUS)
                    time.sleep(POLL_S)
                if not watchdog.end():
                    _exit_at_once(0 if signals.stopping else HUNG_STATUS)


def _opened(config: zenoh.Config, path: str | None, renewal: str | None) -> zenoh.Session:
    """Open the router, and log where it listens.

    Raises:
        ConfigurationError: It cannot listen there, or its credentials cannot be used.
    """
    endpoints = listen_endpoints(config)
    try:
        session = zenoh.open(config)
    except zenoh.ZError as error:
        said = zenoh_error_text(error)
        if renewal is not None and "os error" not in said:
            raise ConfigurationError(f"{path}: {said}; {renewal} writes it again") from None
        setting = "listen" if path is None else f"{path}: listen/endpoints"
        value = endpoints[0] if len(endpoints) == 1 else endpoints
        raise ConfigurationError(cannot_listen(f"{setting} = {value!r}", said)) from None
    listening = listening_endpoints(session, endpoints)
    log.info("router listens on %s", ", ".join(listening) or "nothing")
    return session


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
