"""Waits for the programs that are to see the first frame of a recording."""

from __future__ import annotations

import logging
from collections.abc import Callable

from zenoh_vision import Level, Node, keys
from zenoh_vision.host.wakeup import Wakeup
from zenoh_vision.topics import COMPRESSED, RAW
from zenoh_vision.transport.declarations import ROUTERS, declared_key, sessions_in
from zenoh_vision.transport.query import Query, ask

log = logging.getLogger(__name__)

POLL_S = 0.2


def wait_for_subscribers(node: Node, wanted: int, stopping: Callable[[], bool]) -> None:
    """Wait until so many other programs subscribe to an open camera's frames, in any form.

    Until then its health says how many there are. Without the router's admin space, which counts
    them, it goes on with a warning.
    """
    told: int | None = -1
    pause = Wakeup()
    while not stopping():
        count = subscribers(node)
        if count is None and node.link.connected:
            log.warning("--wait-for: the router does not tell who subscribes; not waiting")
            break
        if count is not None and count >= wanted:
            break
        if count != told:
            there = "" if count is None else f"; there are {count}"
            log.info("waiting for %d subscribers%s", wanted, there)
            node.report("audience", Level.OK, f"waiting for {wanted} subscribers{there}")
            told = count
        pause.wait(POLL_S)
    node.report("audience", Level.OK)


def subscribers(node: Node) -> int | None:
    """Return how many other sessions subscribe to a camera's frames; None if that is unknown."""
    namespace, camera = node.connection.namespace, node.camera
    asked = [
        *(f"{namespace}/{camera}/{topic.name}" for topic in (COMPRESSED, RAW)),
        keys.shared_memory_key(namespace, camera, "*", "*"),
    ]
    session = node.link.session
    admin, *declared = ask(
        session, [Query(ROUTERS), *(Query(declared_key("subscriber", key)) for key in asked)]
    )
    if not any(reply.ok for reply in admin):
        return None
    own = str(session.zid())
    found = [sessions_in(replies, own).values() for replies in declared]
    return len(frozenset().union(*(ids for sessions in found for ids in sessions)))
