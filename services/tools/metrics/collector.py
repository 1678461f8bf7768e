"""From what is known of the nodes to metrics, anew at each scrape."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable

from prometheus_client import Metric
from prometheus_client.registry import Collector
from prometheus_client.utils import floatToGoString

from common.messages import Diagnostics, Histogram, NodeDescription
from services.tools.metrics import families
from services.tools.metrics.board import Board
from services.tools.metrics.families import FAMILIES, Family

DROPPED = "dropped."


class Scrape:
    """All metrics at one moment; each is there, with or without series."""

    def __init__(self) -> None:
        self._metrics = {
            family: Metric(family.stem, family.words, family.kind) for family in FAMILIES
        }

    @property
    def metrics(self) -> list[Metric]:
        """All of them, in the order of the table."""
        return list(self._metrics.values())

    def add(self, family: Family, value: float, *labels: str) -> None:
        """Add one series."""
        named = dict(zip(family.labels, labels, strict=True))
        self._metrics[family].add_sample(family.name, named, value)

    def add_histogram(self, family: Family, histogram: Histogram, *labels: str) -> None:
        """Add the series of a histogram in milliseconds, as one in seconds."""
        named = dict(zip(family.labels, labels, strict=True))
        metric = self._metrics[family]
        for bound, count in zip((*histogram.bounds, None), histogram.counts, strict=True):
            metric.add_sample(f"{family.name}_bucket", {**named, "le": _seconds(bound)}, count)
        metric.add_sample(f"{family.name}_count", named, histogram.counts[-1])
        metric.add_sample(f"{family.name}_sum", named, histogram.sum / 1000)


class NodeCollector(Collector):
    """All metrics of a namespace; what Prometheus' registry asks at each scrape.

    Args:
        board: What is known of the nodes.
        connected: Tells whether there is a router at the moment.
    """

    def __init__(self, board: Board, connected: Callable[[], bool]) -> None:
        self._board = board
        self._connected = connected

    def describe(self) -> Iterable[Metric]:
        """Return the metrics without their series."""
        return Scrape().metrics

    def collect(self) -> Iterable[Metric]:
        """Return all metrics with their series at this moment."""
        now_s = time.monotonic()
        scrape = Scrape()
        scrape.add(families.ROUTER_UP, float(self._connected()))
        for reason, count in self._board.rejected().items():
            scrape.add(families.REJECTED, count, reason)
        for known in self._board.nodes(now_s):
            scrape.add(families.NODE_UP, float(known.up), known.node)
            if known.description is not None:
                _add_description(scrape, known.description)
            if known.health is not None:
                age_s = max(0.0, now_s - known.arrived_s)
                scrape.add(families.REPORT_AGE, age_s, known.node)
                _add_health(scrape, known.health)
        return scrape.metrics


def _add_description(scrape: Scrape, who: NodeDescription) -> None:
    cameras = ",".join(who.cameras)
    scrape.add(families.NODE_INFO, 1, who.node, who.service, cameras, who.version, who.host)


def _add_health(scrape: Scrape, health: Diagnostics) -> None:
    node = health.node
    scrape.add(families.LEVEL, health.level, node)
    scrape.add(families.UPTIME, health.uptime_s, node)
    scrape.add(families.RATE, health.rate_hz, node)
    for name, count in health.counters.items():
        if name == "pending":
            scrape.add(families.PENDING, count, node)
        elif name.startswith(DROPPED):
            scrape.add(families.DROPPED, count, node, name.removeprefix(DROPPED))
        elif name in families.COUNTERS:
            scrape.add(families.COUNTERS[name], count, node)
        else:
            scrape.add(families.OTHER, count, node, name)
    if health.latency_histogram_ms is not None:
        scrape.add_histogram(families.LATENCY, health.latency_histogram_ms, node)


def _seconds(bound_ms: float | None) -> str:
    """Return the bound of a bucket as text; None is infinity."""
    if bound_ms is None:
        return "+Inf"
    text: str = floatToGoString(bound_ms / 1000)  # type: ignore[no-untyped-call]
    return text
