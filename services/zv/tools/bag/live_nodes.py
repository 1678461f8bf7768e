"""Finds the running nodes that publish what is about to be played, also those that start later."""

from __future__ import annotations

import os
import socket
import threading
from collections.abc import Callable, Collection, Mapping

import zenoh

from zenoh_vision import keys
from zenoh_vision.messages import NodeDescription
from zenoh_vision.topics import is_frame_key
from zenoh_vision.transport.link import Link
from zenoh_vision.transport.query import Query, ask, messages_in
from zenoh_vision.transport.session import direct

SETTLE_S = 0.3
"""A node declares its token last, but its inputs and a user's topics may come after it."""


def publishers(
    link: Link,
    namespace: str,
    played: Collection[str],
    stopping: Callable[[], bool],
    player: str = "",
) -> dict[str, NodeDescription]:
    """Return the nodes that publish on some of the keys, by key.

    ``player`` is the name of this process's own node, which is left out; empty without one.
    """
    (replies,) = ask(link.session, [Query(keys.node_key(namespace, "*"))], stopping)
    wanted = set(played)
    own = player, socket.gethostname(), os.getpid()  # pids of two containers may be equal
    return {
        key: about
        for _, about in messages_in(replies, NodeDescription)
        if (about.node, about.host, about.pid) != own
        for key in wanted.intersection(about.publishes)
    }


def camera_among(found: Mapping[str, NodeDescription]) -> str:
    """Return the words about a live camera whose frames would be mixed; empty without one."""
    for key, about in sorted(found.items()):
        if is_frame_key(key):
            return (
                f"{about.node} (pid {about.pid} on {about.host}) publishes {key}; stop it, or play "
                "as another camera (--as NAME) or in another namespace (--namespace NAME)"
            )
    return ""


class LiveWatch:
    """Calls ``look`` on a thread, to find publishers again, when a node has started or ended."""

    def __init__(self, link: Link, namespace: str, look: Callable[[], None]) -> None:
        self._look = look
        self._event = threading.Event()
        self._ended = False
        self._subscription = link.declare(
            lambda session: session.liveliness().declare_subscriber(
                keys.node_key(namespace, "*"), direct(self._note)
            )
        )
        self._thread = threading.Thread(target=self._run, name="live nodes", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """End it."""
        self._ended = True
        self._event.set()
        self._subscription.undeclare()
        self._thread.join(2.0)

    def _note(self, _sample: zenoh.Sample) -> None:
        self._event.set()

    def _run(self) -> None:
        while not self._ended:
            self._event.wait()
            self._event.clear()
            for _ in range(3):  # what it publishes may be declared after its token
                if self._ended:
                    return
                self._look()
                self._event.wait(SETTLE_S)
