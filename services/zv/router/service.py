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
from zv.router.connections import close_without_waiting, cut_connections
from zv.router.rules import LOOK_S, RouterRules
from zv.router.settings import RouterSettings
from zv.router.watchdog import HUNG_S, LAST_ANSWER_S, Watchdog

log = logging.getLogger("router")
POLL_S = 0.1
HUNG_STATUS = 1
HUNG = f"Zenoh has locked up: no answer for {HUNG_S:g} s; ends, to be restarted"
PORT_IN_USE = f"os error {errno.EADDRINUSE}"
PORT_FREE_S = 3.0
"""How long a router with new rules waits for its port. Without, one that is in use for a moment
would have it go on with the former rules, which let in who was revoked."""


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
            renewal = None if rules is None else renewal_of(rules.path)
            try:
                opened = _opened(config, path, renewal, PORT_FREE_S if again else 0.0)
            except ConfigurationError as error:
                if rules is None or not rules.reject(error):
                    raise
                continue
            if again and rules is not None and not rules.fault:
                log.warning("took the new rules in %s; all connections were closed", path)
            again = True
            try:
                _route(opened, health_file, rules, signals)
                # Zenoh does not close a connection that it accepts while it closes the others. It
                # would stay with the former router: with its rules, and without the other clients.
                cut_connections()
            except zenoh.ZError as error:  # of the close, which took longer than Zenoh allows
                said = zenoh_error_text(error)
                log.error("Zenoh has locked up: %s; ends, to be restarted", said)
                _exit_at_once(0 if signals.stopping else HUNG_STATUS)


def _route(
    opened: zenoh.Session,
    health_file: HealthFile,
    rules: RouterRules | None,
    signals: StopSignals,
) -> None:
    """Route until there are other rules, or until told to stop; close the router then."""
    with opened as session:
        watchdog = Watchdog(partial(ask, session))
        look_s = 0.0
        while not signals.stopping and not (rules is not None and rules.changed()):
            health_file.beat("" if rules is None else rules.trouble())
            if watchdog.hangs():
                log.error(HUNG)
                _exit_at_once(HUNG_STATUS)
            if time.monotonic() > look_s:
                look_s = time.monotonic() + LOOK_S
                close_without_waiting()
            time.sleep(POLL_S)
        # A machine that is busy is given more time, unless somebody waits for the end.
        if not watchdog.end(LAST_ANSWER_S if signals.stopping else HUNG_S):
            if not signals.stopping:
                log.error(HUNG)
            _exit_at_once(0 if signals.stopping else HUNG_STATUS)
        if not signals.stopping:
            cut_connections()


def _opened(
    config: zenoh.Config, path: str | None, renewal: str | None, wait_s: float
) -> zenoh.Session:
    """Open the router, and log where it listens.

    Args:
        config: The router's.
        path: The file that it comes from, if any.
        renewal: The command that writes that file again, if it is of ``zv security``.
        wait_s: How long the port may be in use, as by what is left of the former connections.

    Raises:
        ConfigurationError: It cannot listen there, or its credentials cannot be used.
    """
    endpoints = listen_endpoints(config)
    until_s = time.monotonic() + wait_s
    while True:
        try:
            session = zenoh.open(config)
            break
        except zenoh.ZError as error:
            said = zenoh_error_text(error)
        if PORT_IN_USE in said and time.monotonic() < until_s:
            time.sleep(POLL_S)
            continue
        if renewal is not None and "os error" not in said:
            raise ConfigurationError(f"{path}: {said}; {renewal} writes it again")
        setting = "listen" if path is None else f"{path}: listen/endpoints"
        value = endpoints[0] if len(endpoints) == 1 else endpoints
        raise ConfigurationError(cannot_listen(f"{setting} = {value!r}", said))
    listening = listening_endpoints(session, endpoints)
    log.info("router listens on %s", ", ".join(listening) or "nothing")
    return session


def _exit_at_once(status: int) -> NoReturn:
    """End the process without closing a session that has locked up, which would not end either."""
    logging.shutdown()
    os._exit(status)


def cannot_listen(setting: str, reason: str) -> str:
    """Return the error text for a setting (name and value) that Zenoh refused for a reason."""
    if PORT_IN_USE in reason:
        return (
            f"{setting}: the port is in use, perhaps by a running router. "
            "Use that one with --connect, or another port with --listen tcp/127.0.0.1:PORT"
        )
    return f"{setting} is not possible: {reason}; allowed: tcp/ADDRESS:PORT"
