"""Measures capture to decoded frame and to centroid, CPU per frame, and start-up, at one size."""

from __future__ import annotations

import json
import subprocess
import sys
import threading
import time
from typing import Any

import numpy as np

from benchmarks.floor import Floor
from benchmarks.system import System
from zenoh_vision.messages import Centroid, Diagnostics
from zenoh_vision.transport.session import direct

RATE_HZ = 30.0


def percentiles(values: list[float]) -> dict[str, float]:
    """Return p50 and p99, rounded to microseconds."""
    return {
        "p50": round(float(np.percentile(values, 50)), 3),
        "p99": round(float(np.percentile(values, 99)), 3),
    }


def plain_stream(width: int, height: int, seconds: float, floor: Floor) -> dict[str, Any]:
    """One camera, one subscriber that decodes; nothing else runs."""
    count = int(seconds * RATE_HZ)
    with System() as system:
        system.start(
            "camera",
            "-m",
            "benchmarks.camera",
            f"{width}",
            f"{height}",
            f"{RATE_HZ}",
            system.endpoint,
        )
        consumer = subprocess.Popen(
            [sys.executable, "-m", "benchmarks.consumer", system.endpoint, f"{count}"],
            stdout=subprocess.PIPE,
            text=True,
        )
        first_frame(system)
        time.sleep(1)  # the warm-up of the consumer, whose frames do not count
        system.begin()
        begun_s = time.monotonic()
        out, _ = consumer.communicate(timeout=seconds + 60)
        elapsed_s = time.monotonic() - begun_s
        seen = json.loads(out)
        cpu = {name: used / (elapsed_s * RATE_HZ) * 1e3 for name, used in system.cpu_s().items()}
    cpu["subscriber"] = seen["cpu_s"] / count * 1e3
    latency = percentiles(seen["ages_ms"])
    spent = sum(cpu.values())
    return {
        "floor_ms": round(floor.total_ms, 3),
        "floor_opencv_ms": round(floor.opencv_ms, 3),
        "floor_cpu_ms": round(floor.cpu_ms, 3),
        "jpeg_kB": round(floor.kilobytes, 1),
        "latency_ms": latency,
        "over_floor_ms": round(latency["p50"] - floor.total_ms, 3),
        "latency_ratio": round(latency["p50"] / floor.total_ms, 3),
        "latency_ratio_to_opencv": round(latency["p50"] / floor.opencv_ms, 3),
        "cpu_ms_per_frame": {name: round(value, 3) for name, value in cpu.items()},
        "cpu_ratio": round(spent / floor.cpu_ms, 3),
        "cpu_ratio_to_opencv": round(spent / floor.opencv_ms, 3),
        "cpu_ratio_without_router": round((spent - cpu["router"]) / floor.cpu_ms, 3),
        "lost": seen["lost"],
    }


def with_services(width: int, height: int, seconds: float) -> dict[str, Any]:
    """A camera, a tracker and an edge detector: capture to centroid received."""
    ages: list[float] = []
    with System() as system:
        system.start(
            "camera",
            "-m",
            "benchmarks.camera",
            f"{width}",
            f"{height}",
            f"{RATE_HZ}",
            system.endpoint,
        )
        system.service("tracker", "tracker")
        system.service("edge", "edge")
        session = system.session()
        latest: dict[str, Diagnostics] = {}

        def on_centroid(sample: Any) -> None:
            centroid = Centroid.from_bytes(sample.payload.to_bytes())
            ages.append((time.time_ns() - centroid.header.stamp_ns) / 1e6)

        def on_health(sample: Any) -> None:
            health = Diagnostics.from_bytes(sample.payload.to_bytes())
            latest[health.node] = health

        first_frame(system)
        centroids = session.declare_subscriber("vision/front/centroid", direct(on_centroid))
        health = session.declare_subscriber("@vision/diagnostics/*", direct(on_health))
        time.sleep(2)
        ages.clear()
        system.begin()
        time.sleep(seconds)
        cpu = system.cpu_s()
        count = len(ages)
        del centroids, health
        session.close()
    return {
        "centroid_ms": percentiles(ages),
        "centroids": count,
        "of": int(seconds * RATE_HZ),
        "cpu_ms_per_frame": {
            name: round(value / (seconds * RATE_HZ) * 1e3, 3) for name, value in cpu.items()
        },
        "counters": {name: health.counters for name, health in latest.items()},
    }


def start_up() -> dict[str, float]:
    """Seconds from starting a process to its first result, with the router there already."""
    with System() as system:
        session = system.session()
        found: dict[str, float] = {}
        for name, key in (
            ("camera", "vision/front/image/compressed"),
            ("tracker", "vision/front/centroid"),
        ):
            arrived = threading.Event()
            subscriber = session.declare_subscriber(key, direct(lambda _, e=arrived: e.set()))
            begun_s = time.monotonic()
            system.service(name, name)
            if arrived.wait(30):
                found[name] = round(time.monotonic() - begun_s, 3)
            subscriber.undeclare()
        session.close()
    return found


def first_frame(system: System) -> None:
    """Wait until the camera publishes."""
    session = system.session()
    arrived = threading.Event()
    subscriber = session.declare_subscriber(
        "vision/front/image/compressed", direct(lambda _: arrived.set())
    )
    if not arrived.wait(60):
        raise SystemExit("the camera published nothing within 60 s")
    subscriber.undeclare()
    session.close()
