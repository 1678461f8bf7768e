"""What is known of every node: alive or gone, and its newest health. No clock in here."""

from __future__ import annotations

import threading
from collections import Counter
from dataclasses import dataclass, replace

from common.errors import PayloadError
from common.messages import Diagnostics, NodeDescription

SILENT_S = 10.0
"""After so long without health, a node that never showed a token counts as gone."""

MAX_NODES = 1000
MAX_COUNTERS = 100
"""Of one node. More of either is a mistake or malice, and would only swell what is served."""


@dataclass(frozen=True, slots=True)
class Known:
    """What is known of one node.

    Attributes:
        node: Its name.
        up: Whether it is alive.
        since_s: When it was last seen to come or go, monotonic time.
        tokens: Whether it ever showed a liveliness token; its health is no sign of life then.
        health: The newest; None before the first, and when it is gone.
        arrived_s: When that came, monotonic time.
        description: Who it is; None as long as it has not answered.
    """

    node: str
    up: bool
    since_s: float
    tokens: bool = False
    health: Diagnostics | None = None
    arrived_s: float = 0.0
    description: NodeDescription | None = None


class Board:
    """Keeps the newest of every node; from any thread.

    Args:
        gone_s: How long a node that is gone is still listed.
    """

    def __init__(self, gone_s: float) -> None:
        self._gone_s = gone_s
        self._nodes: dict[str, Known] = {}
        self._bad: Counter[str] = Counter()
        self._lock = threading.Lock()

    def came(self, node: str, at_s: float) -> None:
        """Take note of a node's liveliness token.

        Raises:
            PayloadError: ``too_many``.
        """
        with self._lock:
            before = self._known(node)
            if before is None or not before.up:
                self._nodes[node] = Known(node, up=True, since_s=at_s, tokens=True)
            else:
                self._nodes[node] = replace(before, tokens=True)

    def went(self, node: str, at_s: float) -> None:
        """Take note that a token is gone: what the node said holds no more."""
        with self._lock:
            if node in self._nodes:
                self._nodes[node] = Known(node, up=False, since_s=at_s, tokens=True)

    def report(self, node: str, health: Diagnostics, at_s: float) -> None:
        """Take a node's health.

        Args:
            node: Its name by the key.
            health: What came on that key.
            at_s: When, monotonic time.

        Raises:
            PayloadError: ``wrong_node`` or ``too_many``.
        """
        if health.node != node:
            raise PayloadError("wrong_node", f"health of {health.node!r} on the key of {node!r}")
        if len(health.counters) > MAX_COUNTERS:
            raise PayloadError("too_many", f"{len(health.counters)} counters of {node!r}")
        with self._lock:
            before = self._known(node) or Known(node, up=True, since_s=at_s)
            if before.tokens and not before.up:
                return  # its last words came after the end of its token
            if not before.up:
                before = Known(node, up=True, since_s=at_s)
            self._nodes[node] = replace(before, health=health, arrived_s=at_s)

    def describe(self, node: str, description: NodeDescription) -> None:
        """Take a node's description of itself; of one that is not up it is of no use.

        Raises:
            PayloadError: ``wrong_node``.
        """
        if description.node != node:
            raise PayloadError("wrong_node", f"{node!r} describes itself as {description.node!r}")
        with self._lock:
            before = self._nodes.get(node)
            if before is not None and before.up:
                self._nodes[node] = replace(before, description=description)

    def reject(self, error: PayloadError) -> None:
        """Count something that could not be used."""
        with self._lock:
            self._bad[error.reason] += 1

    def rejected(self) -> dict[str, int]:
        """Return how much could not be used, by reason."""
        with self._lock:
            return dict(self._bad)

    def undescribed(self) -> list[str]:
        """Return the nodes that are up and have not said who they are."""
        with self._lock:
            return [known.node for known in self._nodes.values() if _nameless(known)]

    def nodes(self, at_s: float) -> list[Known]:
        """Return all nodes that are up or have not been gone for long, by name."""
        with self._lock:
            self._settle(at_s)
            return [self._nodes[node] for node in sorted(self._nodes)]

    def _known(self, node: str) -> Known | None:
        """Return what is known of a node; refuse a new one when there are too many."""
        before = self._nodes.get(node)
        if before is None and len(self._nodes) >= MAX_NODES:
            raise PayloadError("too_many", f"more than {MAX_NODES} nodes; {node!r} is one more")
        return before

    def _settle(self, at_s: float) -> None:
        for known in list(self._nodes.values()):
            if known.up and not known.tokens and at_s - known.arrived_s > SILENT_S:
                ended_s = known.arrived_s + SILENT_S
                self._nodes[known.node] = known = Known(known.node, up=False, since_s=ended_s)
            if not known.up and at_s - known.since_s > self._gone_s:
                del self._nodes[known.node]


def _nameless(known: Known) -> bool:
    return known.up and known.description is None
