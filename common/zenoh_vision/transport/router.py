"""Runs a router in this process, and asks it for where it listens and whether it works."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from contextlib import contextmanager

import zenoh

from zenoh_vision.transport.session import close_session
from zenoh_vision.transport.zenoh_config import listen_endpoints, router_config

QUERY_TIMEOUT_S = 2.0
PORT_0 = re.compile(r":0(?=$|[?#])")


@contextmanager
def private_router() -> Iterator[tuple[zenoh.Session, str]]:
    """Run a router in this process, on a free port of this machine; yield session and endpoint."""
    config = router_config("tcp/127.0.0.1:0")
    session = zenoh.open(config)
    try:
        yield session, listening_endpoints(session, listen_endpoints(config))[0]
    finally:
        close_session(session)


def listening_endpoints(session: zenoh.Session, endpoints: list[str]) -> list[str]:
    """Return the endpoints at which a router listens; port 0 is replaced by the port it got.

    With several endpoints, or addresses with several ports, return the addresses themselves.

    Args:
        session: Of the router, with its admin space.
        endpoints: Those of its configuration.
    """
    if not any(PORT_0.search(endpoint) for endpoint in endpoints):
        return endpoints
    addresses = _locators(session)
    ports = {address.rpartition(":")[2] for address in addresses}
    if len(endpoints) == len(ports) == 1:
        return [PORT_0.sub(f":{ports.pop()}", endpoints[0])]
    return addresses


def ask(session: zenoh.Session) -> None:
    """Return once a router has answered a query; never, if it has locked up.

    What it answers does not matter: it may have no admin space, and other programs may answer too.
    """
    next(iter(_state(session)), None)


def _state(session: zenoh.Session) -> zenoh.handlers.Handler[zenoh.Reply]:
    return session.get(f"@/{session.zid()}/router", timeout=QUERY_TIMEOUT_S)


def _locators(session: zenoh.Session) -> list[str]:
    """Return the addresses that a router announces, which are all addresses of this machine."""
    for reply in _state(session):
        if reply.ok:
            found: list[str] = json.loads(reply.ok.payload.to_string())["locators"]
            return found
    return []
