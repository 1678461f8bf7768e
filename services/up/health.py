"""The newest health of every node, as it comes over the network."""

from __future__ import annotations

from typing import Any

import zenoh

from common.errors import PayloadError
from common.keys import diagnostics_key
from common.messages import Diagnostics
from common.session import direct


class HealthBoard:
    """Subscribes to the health of all nodes.

    Args:
        session: An open session.
        namespace: First chunk of the keys.
    """

    def __init__(self, session: zenoh.Session, namespace: str) -> None:
        self._newest: dict[str, Diagnostics] = {}
        self._subscriber = session.declare_subscriber(
            diagnostics_key(namespace, "*"), direct(self._on_sample)
        )

    def of(self, node: str) -> Diagnostics | None:
        """Return a node's newest health; None if it has not said anything yet."""
        return self._newest.get(node)

    def forget(self, node: str) -> None:
        """Drop what a node said in an earlier life."""
        self._newest.pop(node, None)

    def _on_sample(self, sample: Any) -> None:
        try:
            health = Diagnostics.from_bytes(sample.payload.to_bytes())
        except PayloadError:
            return  # not one of ours: the table shows what our nodes say
        self._newest[health.node] = health
