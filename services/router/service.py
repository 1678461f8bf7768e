"""The embedded router: a Zenoh session in router mode, and nothing else in its process."""

from __future__ import annotations

import errno
import json
import logging
import re
import signal
import time
from types import FrameType

import zenoh

from common.errors import ConfigurationError
from common.heartbeat import Heartbeat
from common.zenoh_config import listened_on, plain, router_config
from services.router.settings import RouterSettings

log = logging.getLogger("router")
POLL_S = 0.1
ASK_S = 2.0
PORT_0 = re.compile(r":0(?=$|[?#])")


def run(settings: RouterSettings, zenoh_config: str | None = None) -> None:
    """Route until SIGINT or SIGTERM.

    Args:
        settings: The router's options.
        zenoh_config: Zenoh's own JSON5 file; where it states what to listen on, that holds.

    Raises:
        ConfigurationError: An endpoint cannot be listened on; says why and the way out.
    """
    stopping = False

    def on_signal(_number: int, _at: FrameType | None) -> None:
        nonlocal stopping
        stopping = True

    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, on_signal)
    config = router_config(settings.listen, zenoh_config)
    endpoints = listened_on(config)
    try:
        session = zenoh.open(config)
    except zenoh.ZError as error:
        place = "listen" if zenoh_config is None else f"{zenoh_config}: listen/endpoints"
        listen = endpoints[0] if len(endpoints) == 1 else endpoints
        raise ConfigurationError(cannot_listen(f"{place} = {listen!r}", plain(error))) from None
    with session:
        if any(PORT_0.search(endpoint) for endpoint in endpoints):
            endpoints = with_ports(endpoints, addresses_of(session))
        log.info("router listens on %s", ", ".join(endpoints) or "nothing")
        heartbeat = Heartbeat()
        while not stopping:
            heartbeat.beat()
            time.sleep(POLL_S)


def with_ports(endpoints: list[str], addresses: list[str]) -> list[str]:
    """Return endpoints with the ports that were found for 0; the addresses if that is not clear."""
    ports = {address.rpartition(":")[2] for address in addresses}
    if len(endpoints) == len(ports) == 1:
        return [PORT_0.sub(f":{ports.pop()}", endpoints[0])]
    return addresses


def addresses_of(session: zenoh.Session) -> list[str]:
    """Return what a router tells others of where it is: all addresses of this machine."""
    for reply in session.get(f"@/{session.zid()}/router", timeout=ASK_S):
        if reply.ok:
            locators: list[str] = json.loads(reply.ok.payload.to_string())["locators"]
            return locators
    return []


def cannot_listen(setting: str, said: str) -> str:
    """Say why an endpoint cannot be listened on, and the way out."""
    if f"os error {errno.EADDRINUSE}" in said:
        return (
            f"{setting}: the port is taken, perhaps by a router that runs already. "
            "Use that one with --connect, or listen elsewhere with --listen tcp/127.0.0.1:PORT"
        )
    return f"{setting} is not possible: {said}; allowed: tcp/ADDRESS:PORT"
