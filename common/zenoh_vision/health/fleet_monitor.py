"""Feeds a fleet from the network: liveliness tokens, diagnostics, descriptions, parameters."""

from __future__ import annotations

import threading
import time
from collections import Counter
from collections.abc import Callable, Iterable
from functools import partial
from itertools import product
from typing import Any, Literal

import zenoh

from zenoh_vision import keys
from zenoh_vision.error_text import shortened
from zenoh_vision.errors import PayloadError
from zenoh_vision.health.fleet import MAX_NODES, Event, Fleet, ParameterGone
from zenoh_vision.health.node_state import NodeState
from zenoh_vision.messages import Diagnostics, NodeDescription, Parameter
from zenoh_vision.transport.link import Link
from zenoh_vision.transport.query import Query, Reply, send
from zenoh_vision.transport.session import direct

Kind = Literal["token", "diagnostics", "parameter"]
MAX_EVENT_BYTES = 32 << 10
"""Most bytes of diagnostics or a parameter; usual are some hundred."""


def follow(
    link: Link,
    namespace: str,
    kinds: Iterable[Kind],
    take: Callable[[str, Event], None],
    reject: Callable[[PayloadError], None] = lambda _: None,
    names: Iterable[str] = ("*",),
) -> None:
    """Subscribe to events of nodes of a namespace.

    Args:
        link: The link to the router.
        namespace: First chunk of the keys.
        kinds: The kinds of events to follow.
        take: Called with a node's name and each event, on Zenoh's thread; must be quick, and may
            raise ``PayloadError``.
        reject: Called with the error if an event could not be decoded or taken.
        names: The nodes to follow; all by default.
    """

    def receive(kind: Kind, sample: zenoh.Sample) -> None:
        key = str(sample.key_expr)
        try:
            if "*" in key:  # anyone may put and delete on many keys at once
                raise PayloadError("wrong_node", f"{shortened(key)} is the key of no single node")
            take(key.split("/")[2], _event(kind, sample))
        except PayloadError as error:
            reject(error)

    for kind, name in product(kinds, names):
        handler = direct(partial(receive, kind))
        link.declare(partial(_subscribe, kind, namespace, name, handler))


def _subscribe(kind: Kind, namespace: str, name: str, handler: Any, session: zenoh.Session) -> Any:
    if kind == "token":
        tokens = session.liveliness()
        return tokens.declare_subscriber(keys.node_key(namespace, name), handler, history=True)
    if kind == "diagnostics":
        return session.declare_subscriber(keys.diagnostics_key(namespace, name), handler)
    return session.declare_subscriber(keys.parameter_key(namespace, name, "*"), handler)


def _event(kind: Kind, sample: zenoh.Sample) -> Event:
    there = sample.kind == zenoh.SampleKind.PUT
    if kind == "token":
        return there
    if not there and kind == "parameter":
        return ParameterGone(str(sample.key_expr).split("/")[3])
    if not there:
        raise PayloadError("bad_message", f"a delete on {sample.key_expr}")
    if len(sample.payload) > MAX_EVENT_BYTES:  # refused before it is copied
        raise PayloadError("bad_message", f"{len(sample.payload)} bytes on {sample.key_expr}")
    message = Diagnostics if kind == "diagnostics" else Parameter
    return message.from_bytes(sample.payload.to_bytes())


class FleetMonitor:
    """A fleet that follows a namespace over the network, with monotonic times; thread-safe.

    ``complain`` is called with the error of each message that cannot be used; they are counted too.
    """

    def __init__(
        self, fleet: Fleet, complain: Callable[[PayloadError], None] = lambda _: None
    ) -> None:
        self._fleet = fleet
        self._complain = complain
        self._rejected: Counter[str] = Counter()
        self._lock = threading.Lock()

    def watch(
        self,
        link: Link,
        namespace: str,
        *kinds: Literal["token", "diagnostics"],
        names: Iterable[str] = ("*",),
    ) -> None:
        """Begin to follow events of nodes of a namespace, of all by default."""
        follow(link, namespace, kinds, self.take, self._reject, names)

    def take(self, name: str, event: Event) -> None:
        """Apply an event at the current time.

        Raises:
            PayloadError: As for ``Fleet.token`` and ``Fleet.report``.
        """
        with self._lock:
            before = self._fleet.left_out
            if isinstance(event, bool):
                self._fleet.token(name, event, time.monotonic_ns())
            elif isinstance(event, Diagnostics):
                self._fleet.report(name, event, time.monotonic_ns())
            left_out = self._fleet.left_out > before
        if left_out:
            self._reject(PayloadError("too_many", f"more than {MAX_NODES} nodes; one is left out"))

    def ask_new(self, link: Link, namespace: str, again_s: float) -> None:
        """Ask the nodes that have not described themselves, without waiting for the replies."""
        with self._lock:
            names = self._fleet.to_ask(time.monotonic_ns(), again_s)
        for name in names:
            send(link.session, Query(keys.node_key(namespace, name)), self._describe)

    def node(self, name: str) -> NodeState | None:
        """Return what is known of a node now."""
        with self._lock:
            return self._fleet.node(name)

    def nodes(self) -> list[NodeState]:
        """Return all nodes as they are now, by name."""
        with self._lock:
            self._fleet.expire(time.monotonic_ns())
            return self._fleet.nodes()

    def forget(self, name: str) -> None:
        """Remove what is known of a node's former run."""
        with self._lock:
            self._fleet.forget(name)

    def rejected(self) -> dict[str, int]:
        """Return how many messages could not be used, by reason."""
        with self._lock:
            return dict(self._rejected)

    def _describe(self, replies: list[Reply]) -> None:
        for reply in replies:
            if reply.ok is None:
                continue
            try:
                description = reply.message(NodeDescription)
                with self._lock:
                    self._fleet.describe(reply.name, description, time.monotonic_ns())
            except PayloadError as error:
                self._reject(error)

    def _reject(self, error: PayloadError) -> None:
        with self._lock:
            self._rejected[error.reason] += 1
        self._complain(error)
