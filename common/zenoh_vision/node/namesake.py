"""Detects another node of the same name, which sends diagnostics on the same key.

Two tokens on one key look like one, so only their reports distinguish two nodes of one name.
"""

from __future__ import annotations

import logging
from collections import deque
from collections.abc import Callable, Sequence

import zenoh

from zenoh_vision import keys
from zenoh_vision.errors import PayloadError
from zenoh_vision.health.health import Health
from zenoh_vision.health.message_limits import check
from zenoh_vision.host.clock import SYSTEM_CLOCK, Clock
from zenoh_vision.messages import Diagnostics, Level, NodeDescription
from zenoh_vision.topics import COMPRESSED
from zenoh_vision.transport.link import Link
from zenoh_vision.transport.query import Query, Reply, messages_in, send
from zenoh_vision.transport.session import direct

SILENT_S = 3.0
"""After this long without a report the other node is gone."""

MAX_BYTES = 32 << 10
ASK_AGAIN_S = 5.0
MAX_HOST = 64
MOST_BYTES = 1 << 20
MAX_OTHERS = 10
"""Limits of the descriptions that are read and kept: anyone may reply, any number of times."""

FRAMES = "consumers take the frames of the one that opened its source last"
RESULTS = "both publish on the same keys"


class NamesakeMonitor:
    """Watches the diagnostics on a node's own key for those of another node.

    The health is told of the other node; the clock measures how long that has been silent.
    """

    def __init__(
        self,
        node: str,
        health: Health,
        describe: Callable[[], NodeDescription],
        clock: Clock = SYSTEM_CLOCK,
    ) -> None:
        self._clock = clock
        self._node = node
        self._health = health
        self._describe = describe
        self._log = logging.getLogger(node)
        self._sent_ns: deque[int] = deque(maxlen=16)
        self._newest: bytes | None = None
        self._seen_s: float | None = None
        self._asked_s: float | None = None
        self._others: Sequence[NodeDescription] = ()

    def declare(self, link: Link, namespace: str) -> None:
        """Subscribe to what other sessions send on the key."""
        self._link = link
        self._key = keys.node_key(namespace, self._node)
        key = keys.diagnostics_key(namespace, self._node)
        remote = zenoh.Locality.REMOTE
        link.declare(
            lambda session: session.declare_subscriber(
                key, direct(self._receive), allowed_origin=remote
            )
        )

    def note_own(self, report: Diagnostics) -> None:
        """Record this node's own report, which its former session may deliver here."""
        self._sent_ns.append(report.stamp_ns)

    def check(self) -> None:
        """Look for another node in what arrived since the last call; about once a second."""
        newest, self._newest = self._newest, None
        now_s = self._clock.monotonic_ns() / 1e9
        if newest is not None and self._is_of_another(newest):
            self._seen_s = now_s
        if self._seen_s is None:
            return
        if not self._link.connected:
            self._seen_s = now_s  # silence means nothing while no other node can be heard
            return
        if now_s - self._seen_s > SILENT_S:
            self._seen_s = self._asked_s = None
            self._others = ()
            if self._health.message("namesake"):
                self._health.report("namesake", Level.OK)
                self._log.warning("no other node is called %s any more", self._node)
        elif self._asked_s is None or now_s - self._asked_s > ASK_AGAIN_S:
            self._asked_s = now_s
            query = Query(self._key, most_bytes=MOST_BYTES)
            send(self._link.session, query, self._note_descriptions)
        elif now_s - self._asked_s > 1.0 or self._others:
            self._tell()

    def _receive(self, sample: zenoh.Sample) -> None:
        if len(sample.payload) <= MAX_BYTES:
            self._newest = sample.payload.to_bytes()

    def _is_of_another(self, payload: bytes) -> bool:
        try:
            return Diagnostics.from_bytes(payload).stamp_ns not in self._sent_ns
        except PayloadError:
            return False

    def _note_descriptions(self, replies: Sequence[Reply]) -> None:
        own = self._describe()
        found = []
        for reply, about in messages_in(replies, NodeDescription):
            try:
                check(reply.name, about)
            except PayloadError:
                continue
            if (about.host, about.pid, about.started_ns) != (own.host, own.pid, own.started_ns):
                found.append(about)
                if len(found) == MAX_OTHERS:
                    break
        self._others = found

    def _tell(self) -> None:
        """Report the other node in the health, and log it when it is another one than before."""
        own = self._describe()
        others = sorted(self._others, key=lambda about: about.started_ns)
        named = f"{len(others)} others are" if len(others) > 1 else "another node is"
        who = "one that does not describe itself"
        if others:
            about = others[-1]
            order = "later" if about.started_ns > own.started_ns else "earlier"
            who = f"pid {about.pid} on {about.host[:MAX_HOST]}, started {order}"
            who += f" than this one (pid {own.pid})"
        is_camera = any(keys.suffix_of(key) == COMPRESSED.name for key in own.publishes)
        effect = FRAMES if is_camera else RESULTS
        text = f"{named} called {self._node}: {who}; {effect}"
        if text != self._health.message("namesake"):
            self._health.report("namesake", Level.WARN, text)
            rename = ", or give it another name (--camera)" if own.cameras else ""
            self._log.warning("%s; stop one%s", text, rename)
