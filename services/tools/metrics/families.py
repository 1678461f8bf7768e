"""The table of all metrics that are served: names, labels and what they mean.

Names and units follow Prometheus' conventions: one prefix, base units (seconds, hertz), ``_total``
for what only rises. docs/metrics.md and the dashboard are held to this table by tests.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

PREFIX = "zenoh_vision_"


@dataclass(frozen=True, slots=True)
class Family:
    """One metric.

    Attributes:
        name: As it is served; without ``_bucket``, ``_sum``, ``_count`` for a histogram.
        kind: Its type.
        labels: Of each of its series.
        words: What it means.
    """

    name: str
    kind: Literal["gauge", "counter", "histogram", "info"]
    labels: tuple[str, ...]
    words: str

    @property
    def stem(self) -> str:
        """The name without what its type puts behind it."""
        return self.name.removesuffix("_total" if self.kind == "counter" else "_info")


def _family(
    name: str, kind: Literal["gauge", "counter", "histogram", "info"], words: str, *labels: str
) -> Family:
    return Family(PREFIX + name, kind, labels, words)


ROUTER_UP = _family("router_up", "gauge", "Whether this exporter has a Zenoh router: 1 or 0.")
NODE_UP = _family(
    "node_up", "gauge", "Whether a node is alive: 1, or 0 for a while after it is gone.", "node"
)
NODE_INFO = _family(
    "node_info",
    "info",
    "Who a node is; always 1.",
    *("node", "service", "camera", "version", "host"),
)
LEVEL = _family("node_level", "gauge", "Health of a node: 0 OK, 1 WARN, 2 ERROR, 3 STALE.", "node")
UPTIME = _family("node_uptime_seconds", "gauge", "Time since a node's start.", "node")
REPORT_AGE = _family(
    "node_report_age_seconds", "gauge", "Time since a node's last report, due each second.", "node"
)
RATE = _family(
    "frame_rate_hertz", "gauge", "Frames dealt with per second, over 5 s, by the node.", "node"
)
PENDING = _family("frames_pending", "gauge", "Frames that wait or are in work.", "node")
CAPTURED = _family(
    "frames_captured_total", "counter", "Frames read from a camera's source.", "node"
)
PUBLISHED = _family("frames_published_total", "counter", "Frames that a camera sent.", "node")
RECEIVED = _family("frames_received_total", "counter", "Frames that arrived at a consumer.", "node")
PROCESSED = _family("frames_processed_total", "counter", "Frames that a consumer used.", "node")
MISSED = _family(
    "frames_missed_total", "counter", "Frames that never arrived, by gaps in their numbers.", "node"
)
HEADERLESS = _family(
    "frames_without_header_total", "counter", "Frames whose header the receiver made up.", "node"
)
DROPPED = _family(
    "frames_dropped_total", "counter", "Frames that were not used, by reason.", "node", "reason"
)
OTHER = _family(
    "other_total", "counter", "Any other counter of a node, by its name.", "node", "counter"
)
LATENCY = _family(
    "frame_latency_seconds",
    "histogram",
    "Time from a frame's capture until the node was done with it.",
    "node",
)
REJECTED = _family(
    "exporter_messages_rejected_total",
    "counter",
    "Reports of nodes that this exporter could not use, by reason.",
    "reason",
)

FAMILIES = (
    *(ROUTER_UP, NODE_UP, NODE_INFO, LEVEL, UPTIME, REPORT_AGE, RATE, PENDING),
    *(CAPTURED, PUBLISHED, RECEIVED, PROCESSED, MISSED, HEADERLESS, DROPPED, OTHER),
    *(LATENCY, REJECTED),
)

COUNTERS = {
    "captured": CAPTURED,
    "published": PUBLISHED,
    "received": RECEIVED,
    "processed": PROCESSED,
    "missed": MISSED,
    "assumed_headers": HEADERLESS,
}
"""Counters of ``Diagnostics`` that have a metric of their own."""
