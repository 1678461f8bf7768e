"""What is served, read back by Prometheus' own parsers."""

from __future__ import annotations

import math
import re
import time

import pytest
from prometheus_client import CollectorRegistry, generate_latest
from prometheus_client.openmetrics import exposition as openmetrics
from prometheus_client.openmetrics.parser import (
    text_string_to_metric_families as parse_openmetrics,
)
from prometheus_client.parser import text_string_to_metric_families as parse

from tests.support.node_states import description, report
from zenoh_vision.health.fleet import Fleet
from zenoh_vision.health.fleet_monitor import FleetMonitor
from zenoh_vision.health.latency import LatencyMonitor
from zenoh_vision.health.node_state import S
from zenoh_vision.messages import Diagnostics, Histogram
from zv.tools.metrics.collector import NodeCollector
from zv.tools.metrics.families import COUNTERS, FAMILIES, PREFIX

COUNTED = {
    "received": 100,
    "processed": 90,
    "dropped.overwritten": 6,
    "dropped.stale": 3,
    "pending": 1,
    "missed": 12,
    "assumed_headers": 2,
    "zones": 4,
}


def health(node: str = "tracker_front", **fields: object) -> Diagnostics:
    histogram = Histogram(bounds=(5.0, 70.0), counts=(2, 3, 4), sum=265.5)
    known = {"level": 1, "uptime_s": 12.5, "counters": COUNTED, "rate_hz": 29.75}
    return report(node=node, **known | {"latency_histogram_ms": histogram} | fields)


@pytest.fixture
def fleet() -> Fleet:
    return Fleet(forget_s=300.0)


def text(fleet: Fleet, connected: bool = True) -> str:
    registry = CollectorRegistry()
    registry.register(NodeCollector(FleetMonitor(fleet), lambda: connected))
    return generate_latest(registry).decode()


def series(fleet: Fleet, connected: bool = True) -> dict[tuple[str, ...], float]:
    """Return every series as (name, label values in order of their names) and its value."""
    return {
        (sample.name, *(sample.labels[name] for name in sorted(sample.labels))): sample.value
        for family in parse(text(fleet, connected))
        for sample in family.samples
    }


def test_the_counters_of_a_node_become_series_with_its_name(fleet: Fleet):
    fleet.report("tracker_front", health(), time.monotonic_ns())
    found = series(fleet)
    node = "tracker_front"
    assert {name: value for name, value in found.items() if "_frames_" in name[0]} == {
        ("zenoh_vision_frames_received_total", node): 100,
        ("zenoh_vision_frames_processed_total", node): 90,
        ("zenoh_vision_frames_dropped_total", node, "overwritten"): 6,
        ("zenoh_vision_frames_dropped_total", node, "stale"): 3,
        ("zenoh_vision_frames_pending", node): 1,
        ("zenoh_vision_frames_missed_total", node): 12,
        ("zenoh_vision_frames_without_header_total", node): 2,
    }
    assert found["zenoh_vision_other_total", "zones", node] == 4


def test_what_a_camera_counts(fleet: Fleet):
    counters = {"captured": 9, "published": 5, "dropped.no_subscriber": 4, "pending": 0}
    fleet.report("camera_front", health("camera_front", counters=counters), time.monotonic_ns())
    found = series(fleet)
    assert found["zenoh_vision_frames_captured_total", "camera_front"] == 9
    assert found["zenoh_vision_frames_published_total", "camera_front"] == 5
    assert found["zenoh_vision_frames_dropped_total", "camera_front", "no_subscriber"] == 4


def test_health_is_level_uptime_rate_and_age(fleet: Fleet):
    fleet.report("tracker_front", health(), time.monotonic_ns() - 2 * S)
    found = series(fleet)
    assert found["zenoh_vision_node_up", "tracker_front"] == 1
    assert found["zenoh_vision_node_level", "tracker_front"] == 1
    assert found["zenoh_vision_node_uptime_seconds", "tracker_front"] == 12.5
    assert found["zenoh_vision_frame_rate_hertz", "tracker_front"] == 29.75
    assert 2.0 <= found["zenoh_vision_node_report_age_seconds", "tracker_front"] < 10.0


def test_the_lag_of_a_source_is_in_seconds_and_has_no_series_where_it_is_unknown(fleet: Fleet):
    fleet.report("tracker_front", health(), time.monotonic_ns())
    lagging = health("camera_front", source_lag_ms=41.5)
    fleet.report("camera_front", lagging, time.monotonic_ns())
    found = {key: value for key, value in series(fleet).items() if "lag" in key[0]}
    assert found == {("zenoh_vision_source_lag_seconds", "camera_front"): 0.0415}


def test_latencies_are_a_histogram_in_seconds(fleet: Fleet):
    fleet.report("tracker_front", health(), time.monotonic_ns())
    name, node = "zenoh_vision_frame_latency_seconds", "tracker_front"
    latencies = {key: value for key, value in series(fleet).items() if "latency" in key[0]}
    assert latencies == {
        (f"{name}_bucket", "0.005", node): 2,
        (f"{name}_bucket", "0.07", node): 3,
        (f"{name}_bucket", "+Inf", node): 4,
        (f"{name}_count", node): 4,
        (f"{name}_sum", node): 0.2655,
    }


def test_the_bounds_that_our_nodes_use_are_exact_in_seconds(fleet: Fleet):
    fleet.report(
        "tracker_front",
        health(latency_histogram_ms=LatencyMonitor().histogram()),
        time.monotonic_ns(),
    )
    bounds = re.findall(r'le="([^"]+)"', text(fleet))
    assert bounds[:7] == ["0.001", "0.002", "0.003", "0.005", "0.007", "0.01", "0.015"]
    assert bounds[-2:] == ["5.0", "+Inf"]
    assert max(map(len, bounds)) <= len("0.001")


def test_a_node_without_a_histogram_has_no_latency(fleet: Fleet):
    fleet.report("tracker_front", health(latency_histogram_ms=None), time.monotonic_ns())
    assert not [key for key in series(fleet) if "latency" in key[0]]


def test_the_info_metric_describes_a_node(fleet: Fleet):
    fleet.token("tracker_front", True, time.monotonic_ns())
    fleet.describe("tracker_front", description(cameras=("front", "back"), host="here"))
    (line,) = [line for line in text(fleet).splitlines() if line.startswith(f"{PREFIX}node_info")]
    assert line == (
        'zenoh_vision_node_info{camera="front,back",host="here",node="tracker_front",'
        'service="tracker",version="0.1.0"} 1.0'
    )


def test_of_a_node_that_is_gone_nothing_is_left_but_that_it_is_down(fleet: Fleet):
    fleet.token("tracker_front", True, time.monotonic_ns())
    fleet.report("tracker_front", health(), time.monotonic_ns())
    fleet.token("tracker_front", False, time.monotonic_ns())
    assert {key: value for key, value in series(fleet).items() if "tracker_front" in key} == {
        ("zenoh_vision_node_up", "tracker_front"): 0
    }


@pytest.mark.parametrize("connected", [True, False])
def test_the_router_is_up_or_not_with_or_without_nodes(fleet: Fleet, connected: bool):
    assert series(fleet, connected) == {("zenoh_vision_router_up",): float(connected)}


@pytest.mark.parametrize(
    "node",
    ['quote"', "back\\slash", "new\nline", "umlaut ä", "{brace}", "a" * 300, ""],
    ids=lambda name: ascii(name)[:12],
)
def test_no_name_of_a_node_or_counter_breaks_the_text(fleet: Fleet, node: str):
    counters = {f"dropped.{node}": 1, node or "x": 2}
    fleet.report(node, health(node, counters=counters), time.monotonic_ns())
    found = series(fleet)
    assert found["zenoh_vision_node_level", node] == 1
    assert found["zenoh_vision_frames_dropped_total", node, node] == 1
    assert found["zenoh_vision_other_total", node or "x", node] == 2


def test_the_openmetrics_text_parses_too(fleet: Fleet):
    fleet.token("tracker_front", True, time.monotonic_ns())
    fleet.report("tracker_front", health(), time.monotonic_ns())
    registry = CollectorRegistry()
    registry.register(NodeCollector(FleetMonitor(fleet), lambda: True))
    names = {
        family.name for family in parse_openmetrics(openmetrics.generate_latest(registry).decode())
    }
    assert names == {family.stem for family in FAMILIES}


def test_every_metric_of_the_table_is_served_and_nothing_else_is(fleet: Fleet):
    served = re.findall(r"^# TYPE (\S+) (\S+)$", text(fleet), re.MULTILINE)
    shown_as = {"info": "gauge"}
    assert served == [(f.name, shown_as.get(f.kind, f.kind)) for f in FAMILIES]
    assert set(COUNTERS.values()) <= set(FAMILIES)


@pytest.mark.parametrize("family", FAMILIES, ids=lambda family: family.name)
def test_names_follow_the_conventions_of_prometheus(family):
    # https://prometheus.io/docs/practices/naming: one prefix, base units, _total for counters.
    assert re.fullmatch(r"zenoh_vision(_[a-z]+)+", family.name)
    assert family.name.endswith("_total") == (family.kind == "counter")
    assert family.name.endswith("_info") == (family.kind == "info")
    assert not re.search(r"_(ms|millis\w*|percent|hz|mb|count|sum|bucket)(_|$)", family.name)
    if family.kind == "histogram":
        assert family.name.endswith("_seconds")
    assert family.words.endswith(".")
    assert "node" in family.labels or family.name in {
        "zenoh_vision_router_up",
        "zenoh_vision_exporter_messages_rejected_total",
    }


def test_no_value_is_nan(fleet: Fleet):
    fleet.report("tracker_front", health(), time.monotonic_ns())
    assert not any(math.isnan(value) for value in series(fleet).values())
