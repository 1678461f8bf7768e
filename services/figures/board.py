"""The newest health of every node, as it comes over the network."""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import Any

from common.errors import PayloadError
from common.keys import diagnostics_key
from common.link import Link
from common.messages import Diagnostics
from common.session import direct

SILENT_S = 3.0
"""Health comes once a second: a node that says nothing for so long is stuck or cut off."""


@dataclass(frozen=True, slots=True)
class Report:
    """What a node said, and the monotonic time when it came."""

    health: Diagnostics
    arrived_s: float


class HealthBoard:
    """Subscribes to the health of all nodes.

    Args:
        link: To the router.
        namespace: First chunk of the keys.
    """

    def __init__(self, link: Link, namespace: str) -> None:
        self._newest: dict[str, Report] = {}
        link.declare(
            lambda session: session.declare_subscriber(
                diagnostics_key(namespace, "*"), direct(self._on_sample)
            )
        )

    def of(self, node: str) -> Report | None:
        """Return a node's newest report; None if it has not said anything yet."""
        return self._newest.get(node)

    def forget(self, node: str) -> None:
        """Drop what a node said in an earlier life."""
        self._newest.pop(node, None)

    def _on_sample(self, sample: Any) -> None:
        try:
            health = Diagnostics.from_bytes(sample.payload.to_bytes())
        except PayloadError:
            return  # not one of ours: what is shown is what our nodes say
        self._newest[health.node] = Report(health, time.monotonic())
