"""What is needed to understand a recording: asked of the nodes, again when one appears."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from typing import Final

from zenoh_vision import keys
from zenoh_vision.keys import is_picture
from zenoh_vision.messages import NodeDescription
from zenoh_vision.topics import TOPICS, topic_of
from zenoh_vision.transport.link import Link
from zenoh_vision.transport.query import Query, Reply, ask, messages_in
from zv.bag.record import Record
from zv.bag.recording import matcher
from zv.bag.samples import LogClock, record_of

PERIOD_S: Final = 2.0
MAX_NODES: Final = 2000
MAX_OWN: Final = 200
MAX_BYTES: Final = 64 << 20


class SystemState:
    """Asks the nodes for descriptions, parameters, schemas and latched messages, on a thread.

    ``take`` is called with each reply that says something new, ``found`` with the keys that nodes
    publish.
    """

    def __init__(
        self,
        link: Link,
        namespace: str,
        exclude: Sequence[str],
        clock: LogClock,
        take: Callable[[Record], None],
        found: Callable[[Iterable[str]], None],
    ) -> None:
        self._link, self._namespace, self._clock = link, namespace, clock
        self._is_excluded = matcher(exclude, without_any=False)
        self._take, self._found = take, found
        self._known: dict[tuple[str, bytes], None] = {}
        self._nodes: dict[tuple[str, int, int], NodeDescription] = {}
        self._newest: dict[str, Record] = {}
        self._ended = threading.Event()
        self._lock = threading.Lock()
        self._thread = threading.Thread(target=self._run, name="state", daemon=True)

    def start(self) -> None:
        """Ask for the first time, then on a thread of its own."""
        self.ask()
        self._thread.start()

    def close(self) -> None:
        """End the thread."""
        self._ended.set()
        self._thread.join(PERIOD_S)

    def records(self) -> list[Record]:
        """Return the newest reply of each key, with which another file begins."""
        with self._lock:
            return list(self._newest.values())

    def update(self, record: Record) -> None:
        """Note a newer sample of a key that was asked for, such as a change of a parameter."""
        with self._lock:
            if record.key in self._newest and not record.deleted:
                self._newest[record.key] = record

    def ask(self) -> None:
        """Ask all nodes for their descriptions, and new ones for the rest."""
        # The router's list of publishers would show keys of other programs too, but listing them
        # while one is declared can lock the router up (zenoh #2619).
        (described,) = ask(
            self._link.session, [Query(keys.node_key(self._namespace, "*"))], self._ended.is_set
        )
        published: set[str] = set()
        is_new, own = False, list[str]()
        for reply, node in messages_in(described, NodeDescription):
            published.update(node.publishes)
            if self._note_node(reply, node):
                is_new = True
                own += [key for key in node.publishes if topic_of(key) is None and "*" not in key]
        self._found(published)
        if is_new:
            self._ask_rest(own[:MAX_OWN])

    def _note_node(self, reply: Reply, node: NodeDescription) -> bool:
        """Keep a description that is new or has changed; return whether the node is new."""
        identity = node.node, node.pid, node.started_ns
        known = self._nodes.get(identity)
        if known is None and len(self._nodes) >= MAX_NODES:
            return False
        compared = node.model_copy(update={"stamp_ns": None, "rate_hz": None})
        self._nodes[identity] = compared
        if known != compared:
            self._keep(reply, is_new=True)
        return known is None

    def _ask_rest(self, own: list[str]) -> None:
        """Ask for parameters, schemas, health, and the newest of what may be latched.

        Args:
            own: Keys of topics that nodes outside of this project publish.
        """
        asked = [
            keys.parameters_key(self._namespace, "*"),
            keys.schema_key(self._namespace, "*"),
            keys.diagnostics_key(self._namespace, "*"),  # what was dropped before counts from here
            TOPICS["camera_info"].key(self._namespace, "*"),
            *own,
        ]
        for replies in ask(self._link.session, map(Query, asked), self._ended.is_set):
            for reply in replies:
                self._keep(reply)

    def _keep(self, reply: Reply, *, is_new: bool = False) -> None:
        if reply.ok is None or self._is_excluded(reply.key):
            return
        if is_picture(str(reply.ok.encoding)):
            return  # a picture is not latched: the next one comes
        record = record_of(reply.ok, self._clock.now_ns(), "query")
        known = record.key, record.payload
        if known in self._known and not is_new:
            return
        if len(self._known) >= 10 * MAX_NODES:
            self._known.clear()
        if len(record.payload) > MAX_BYTES:
            return
        self._known[known] = None
        with self._lock:
            self._newest[record.key] = record
        self._take(record)

    def _run(self) -> None:
        while not self._ended.wait(PERIOD_S):
            with suppress(Exception):  # of a session that is being replaced: ask again
                self.ask()
