"""The embedded router: a Zenoh session in router mode, and nothing else in its process."""

from __future__ import annotations

import errno
import logging
import signal
import time
from types import FrameType

import zenoh

from common.errors import ConfigurationError
from common.heartbeat import Heartbeat
from common.session import plain, router_config
from services.router.settings import RouterSettings

log = logging.getLogger("router")
POLL_S = 0.1


def run(settings: RouterSettings, zenoh_config: str | None = None) -> None:
    """Route until SIGINT or SIGTERM.

    Raises:
        ConfigurationError: The endpoint cannot be listened on; says why and the way out.
    """
    listen = settings.listen
    stopping = False

    def on_signal(_number: int, _at: FrameType | None) -> None:
        nonlocal stopping
        stopping = True

    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, on_signal)
    try:
        session = zenoh.open(router_config(listen, zenoh_config))
    except zenoh.ZError as error:
        raise ConfigurationError(cannot_listen(listen, plain(error))) from None
    with session:
        log.info("router listens on %s", listen)
        heartbeat = Heartbeat()
        while not stopping:
            heartbeat.beat()
            time.sleep(POLL_S)


def cannot_listen(listen: str, said: str) -> str:
    """Say why an endpoint cannot be listened on, and the way out."""
    if f"os error {errno.EADDRINUSE}" in said:
        return (
            f"listen = {listen!r}: the port is taken, perhaps by a router that runs already. "
            "Use that one with --connect, or listen elsewhere with --listen tcp/127.0.0.1:PORT"
        )
    return f"listen = {listen!r} is not possible: {said}; allowed: tcp/ADDRESS:PORT"
