"""The newest health of every node, as it comes over the network."""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import Any

import zenoh

from common.diagnostics import ERROR
from common.errors import PayloadError
from common.keys import diagnostics_key
from common.messages import Diagnostics
from common.session import direct
from services.up.processes import Child

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
        session: An open session.
        namespace: First chunk of the keys.
    """

    def __init__(self, session: zenoh.Session, namespace: str) -> None:
        self._newest: dict[str, Report] = {}
        self._subscriber = session.declare_subscriber(
            diagnostics_key(namespace, "*"), direct(self._on_sample)
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
            return  # not one of ours: the table shows what our nodes say
        self._newest[health.node] = Report(health, time.monotonic())


def trouble_of(child: Child, report: Report | None) -> str:
    """Return why a node does no work; nothing while it does, starts, or has finished."""
    if child.state in ("starting", "finished"):
        return ""
    if not child.alive:
        return f"{child.name} {child.state}"
    if report is None:
        return ""  # the router says nothing of itself
    silent_s = time.monotonic() - report.arrived_s
    if silent_s > SILENT_S:
        return f"{child.name} silent for {silent_s:.0f} s"
    health = report.health
    return f"{child.name}: {health.message}" if health.level == ERROR else ""
