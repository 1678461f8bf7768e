"""The table of all metrics: names, labels and meanings.

Names and units follow Prometheus' conventions: one prefix, base units (seconds, hertz), ``_total``
for counters. Tests compare docs/metrics.md and the dashboard with this table.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

PREFIX = "zenoh_vision_"


@dataclass(frozen=True, slots=True)
class Family:
    """One metric.

    Attributes:
        name: Name that is served; of a histogram, without ``_bucket``, ``_sum``, ``_count``.
    """

    name: str
    kind: Literal["gauge", "counter", "histogram", "info"]
    labels: tuple[str, ...]
    words: str

    @property
    def stem(self) -> str:
        """The name without the suffix of its type."""
        return self.name.removesuffix("_total" if self.kind == "counter" else "_info")


def _gauge(name: str, words: str, *labels: str) -> Family:
    return Family(PREFIX + name, "gauge", labels, words)


def _counter(name: str, words: str, *labels: str) -> Family:
    return Family(f"{PREFIX}{name}_total", "counter", labels, words)


ROUTER_UP = _gauge("router_up", "1 if this exporter is connected to a Zenoh router, else 0.")
NODE_UP = _gauge("node_up", "1 if a node is alive, 0 for a while after it is gone.", "node")
NODE_INFO = Family(
    PREFIX + "node_info",
    "info",
    ("node", "service", "camera", "version", "host"),
    "Description of a node, in the labels; always 1.",
)
LEVEL = _gauge("node_level", "Health of a node: 0 OK, 1 WARN, 2 ERROR, 3 STALE.", "node")
UPTIME = _gauge("node_uptime_seconds", "Time since a node's start.", "node")
REPORT_AGE = _gauge(
    "node_report_age_seconds", "Time since a node's last report; nodes report every second.", "node"
)
RATE = _gauge(
    "frame_rate_hertz", "Frames published or processed per second by a node, over 5 s.", "node"
)
SOURCE_LAG = _gauge(
    "source_lag_seconds", "Age of a camera's newest frame when it came from its source.", "node"
)
DROPPED = _counter("frames_dropped", "Frames that were not used, by reason.", "node", "reason")
OTHER = _counter("other", "Any other counter of a node, by its name.", "node", "counter")
LATENCY = Family(
    PREFIX + "frame_latency_seconds",
    "histogram",
    ("node",),
    "Time from a frame's capture until the node finished it.",
)
REJECTED = _counter(
    "exporter_messages_rejected",
    "Reports of nodes that this exporter could not use, by reason.",
    "reason",
)

COUNTERS = {
    "pending": _gauge("frames_pending", "Frames that wait or are being processed.", "node"),
    "captured": _counter("frames_captured", "Frames read from a camera's source.", "node"),
    "published": _counter("frames_published", "Frames that a camera sent.", "node"),
    "received": _counter("frames_received", "Frames that arrived at a consumer.", "node"),
    "processed": _counter("frames_processed", "Frames that a consumer used.", "node"),
    "missed": _counter(
        "frames_missed", "Frames that never arrived, from gaps in sequence numbers.", "node"
    ),
    "model_frames": _counter("model_frames", "Frames that a tracker's model has seen.", "node"),
    "model_us": _counter("model_seconds", "Time that a tracker's model took for frames.", "node"),
    "model_wait_us": _counter(
        "model_wait_seconds", "Time that frames waited for a tracker's model.", "node"
    ),
    "assumed_headers": _counter(
        "frames_without_header",
        "Frames without a header, for which the receiver assumed one.",
        "node",
    ),
}
"""Counters of ``Diagnostics`` that have a metric of their own."""

MICROSECONDS = ("model_us", "model_wait_us")
"""Those of them that count microseconds."""

FAMILIES = (
    *(ROUTER_UP, NODE_UP, NODE_INFO, LEVEL, UPTIME, REPORT_AGE, RATE, SOURCE_LAG),
    *(*COUNTERS.values(), DROPPED, OTHER, LATENCY, REJECTED),
)
