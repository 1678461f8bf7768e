"""Converts the state of the nodes to metrics at each scrape."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable

from prometheus_client import Metric
from prometheus_client.registry import Collector

from zenoh_vision.health.fleet_monitor import FleetMonitor
from zenoh_vision.messages import Diagnostics, Histogram
from zv.tools.metrics import families
from zv.tools.metrics.families import FAMILIES, Family

DROPPED = "dropped."


class Scrape:
    """All metrics at one moment, including those without series, in the order of the table."""

    def __init__(self) -> None:
        self._metrics = {
            family: Metric(family.stem, family.words, family.kind) for family in FAMILIES
        }
        self.metrics = list(self._metrics.values())

    def add(self, family: Family, value: float, *labels: str) -> None:
        """Add one series."""
        named = dict(zip(family.labels, labels, strict=True))
        self._metrics[family].add_sample(family.name, named, value)

    def add_diagnostics(self, report: Diagnostics) -> None:
        """Add the metrics of a node's diagnostics."""
        node = report.node
        self.add(families.LEVEL, report.level, node)
        self.add(families.UPTIME, report.uptime_s, node)
        self.add(families.RATE, report.rate_hz, node)
        if report.source_lag_ms is not None:
            self.add(families.SOURCE_LAG, report.source_lag_ms / 1000, node)
        for name, count in report.counters.items():
            if name.startswith(DROPPED):
                self.add(families.DROPPED, count, node, name.removeprefix(DROPPED))
            elif name in families.COUNTERS:
                value = count / 1e6 if name in families.MICROSECONDS else count
                self.add(families.COUNTERS[name], value, node)
            else:
                self.add(families.OTHER, count, node, name)
        if report.latency_histogram_ms is not None:
            self._add_latencies(report.latency_histogram_ms, node)

    def _add_latencies(self, histogram: Histogram, node: str) -> None:
        name, metric = families.LATENCY.name, self._metrics[families.LATENCY]
        bounds = [*(str(bound_ms / 1000) for bound_ms in histogram.bounds), "+Inf"]
        for bound, count in zip(bounds, histogram.counts, strict=True):
            metric.add_sample(f"{name}_bucket", {"node": node, "le": bound}, count)
        metric.add_sample(f"{name}_count", {"node": node}, histogram.counts[-1])
        metric.add_sample(f"{name}_sum", {"node": node}, histogram.sum / 1000)


class NodeCollector(Collector):
    """The metrics of a namespace, which Prometheus' registry collects at each scrape."""

    def __init__(self, monitor: FleetMonitor, connected: Callable[[], bool]) -> None:
        self._monitor = monitor
        self._connected = connected

    def describe(self) -> Iterable[Metric]:
        """Return the metrics without their series."""
        return Scrape().metrics

    def collect(self) -> Iterable[Metric]:
        """Return all metrics with their series at this moment."""
        scrape = Scrape()
        scrape.add(families.ROUTER_UP, float(self._connected()))
        for reason, count in self._monitor.rejected().items():
            scrape.add(families.REJECTED, count, reason)
        nodes, now_ns = self._monitor.nodes(), time.monotonic_ns()
        for node in nodes:
            scrape.add(families.NODE_UP, float(node.alive), node.name)
            if not node.alive:
                continue
            about = node.description
            if about is not None and node.answered:
                cameras = ",".join(about.cameras)
                labels = (about.node, about.service, cameras, about.version, about.host)
                scrape.add(families.NODE_INFO, 1, *labels)
            if node.report is not None:
                scrape.add(families.REPORT_AGE, node.report_age_s(now_ns), node.name)
                scrape.add_diagnostics(node.report)
        return scrape.metrics
