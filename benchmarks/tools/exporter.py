"""Measures the cost of ``zv metrics``: following many nodes and answering scrapes."""

from __future__ import annotations

import subprocess
import sys
import threading
import time
import urllib.request
from typing import Any

from benchmarks.stream import percentiles
from benchmarks.system import System, free_endpoint
from zenoh_vision.health.latency import LatencyMonitor
from zenoh_vision.messages import Diagnostics, Latency

BARE = """
import json, sys, time, zenoh
config = zenoh.Config()
for key, value in (("mode", "client"), ("connect/endpoints", [sys.argv[1]])):
    config.insert_json5(key, json.dumps(value))
count = [0]
def heard(sample):
    count[0] += len(sample.payload.to_bytes())
with zenoh.open(config) as session:
    key = "@vision/diagnostics/*"
    kept = session.declare_subscriber(key, zenoh.handlers.Callback(heard, indirect=False))
    time.sleep(10000)
"""
"""The floor: a subscriber that takes every report and does nothing with it."""

SCRAPE_PERIOD_S = 1.0


class Nodes:
    """Simulated nodes, each a token and a report a second, within the ``with`` block.

    Args:
        system: The system under test.
        number: Number of nodes.
    """

    def __init__(self, system: System, number: int) -> None:
        self._session = system.session()
        names = [f"tracker_c{index}" for index in range(number)]
        liveliness = self._session.liveliness()
        self._tokens = [liveliness.declare_token(f"@vision/node/{name}") for name in names]
        self._reports = {f"@vision/diagnostics/{name}": report(name) for name in names}
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def close(self) -> None:
        """End them all."""
        self._stop.set()
        self._thread.join()
        self._session.close()

    def _run(self) -> None:
        pause_s = 1.0 / len(self._reports)
        while not self._stop.is_set():
            for key, payload in self._reports.items():
                self._session.put(key, payload)
                self._stop.wait(pause_s)


def report(node: str) -> bytes:
    """Return a node's report as real ones are: 700 bytes."""
    counters = {"received": 10_000, "processed": 9_900, "dropped.overwritten": 60}
    health = Diagnostics(
        node=node,
        stamp_ns=time.time_ns(),
        level=0,
        message="ok",
        uptime_s=333.0,
        counters={**counters, "dropped.stale": 40, "pending": 0, "missed": 3},
        rate_hz=29.97,
        latency_ms=Latency(p50=8.5, p99=14.0),
        latency_histogram_ms=LatencyMonitor().histogram(),
    )
    return health.to_bytes()


def cost(number: int, seconds: float) -> dict[str, Any]:
    """Measure the CPU time of the exporter, idle and scraped once a second.

    Args:
        number: Number of nodes, each with a report a second.
        seconds: Duration of each of the two measurements.
    """
    with System() as system:
        system.start("bare", "-c", BARE, system.endpoint)
        listen = free_endpoint().removeprefix("tcp/")
        system.service("metrics", "metrics", "--listen", listen)
        url = f"http://{listen}/metrics"
        nodes = Nodes(system, number)
        while not _served(url, number):
            time.sleep(0.2)
        unasked = _cpu_percent(system, seconds)
        times_ms: list[float] = []
        end = threading.Event()
        scraper = threading.Thread(target=_scrape_until, args=(end, url, times_ms))
        scraper.start()
        scraped = _cpu_percent(system, seconds)
        end.set()
        scraper.join()
        size = len(scrape(url))
        memory_mb = system.memory_mb()["metrics"]
        nodes.close()
    return {
        "nodes": number,
        "cpu_percent": {
            "bare_subscriber": unasked["bare"],
            "unasked": unasked["metrics"],
            "scraped_once_a_second": scraped["metrics"],
            "per_node_scraped": round(scraped["metrics"] / number, 3),
        },
        "scrape_ms": percentiles(times_ms),
        "scrape_bytes": size,
        "memory_mb": round(memory_mb, 1),
    }


def scrape(url: str) -> bytes:
    """Return the served metrics."""
    with urllib.request.urlopen(url, timeout=10) as answer:
        body: bytes = answer.read()
        return body


def _served(url: str, number: int) -> bool:
    """Tell whether the exporter is up and knows this number of nodes."""
    try:
        return scrape(url).count(b"\nzenoh_vision_node_level{") >= number
    except OSError:
        return False


def _scrape_until(end: threading.Event, url: str, times_ms: list[float]) -> None:
    while not end.wait(SCRAPE_PERIOD_S):
        began_s = time.perf_counter()
        scrape(url)
        times_ms.append((time.perf_counter() - began_s) * 1000)


def _cpu_percent(system: System, seconds: float) -> dict[str, float]:
    system.begin()
    began_s = time.monotonic()
    time.sleep(seconds)
    elapsed_s = time.monotonic() - began_s
    return {name: round(cpu / elapsed_s * 100, 2) for name, cpu in system.cpu_s().items()}


def help_times(runs: int = 7) -> dict[str, float]:
    """Return seconds from start to end of ``--help``, the best of several runs."""
    found = {}
    for words in (["--help"], ["camera", "--help"], ["metrics", "--help"]):
        times_s = []
        for _ in range(runs):
            began_s = time.perf_counter()
            command = [sys.executable, "-m", "zv", *words]
            subprocess.run(command, stdout=subprocess.DEVNULL, check=True)
            times_s.append(time.perf_counter() - began_s)
        found[" ".join(["zv", *words])] = round(min(times_s), 3)
    return found
