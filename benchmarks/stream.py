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
from benchmarks.system import System, Watch
from zenoh_vision.transport.session import direct

RATE_HZ = 30.0


def percentiles(values: list[float]) -> dict[str, float]:
    """Return p50 and p99, rounded to microseconds."""
    return {
        "p50": round(float(np.percentile(values, 50)), 3),
        "p99": round(float(np.percentile(values, 99)), 3),
    }


def watched(
    width: int, height: int, count: int, transport: str = "jpeg", system: type[System] = System
) -> tuple[dict[str, Any], dict[str, float]]:
    """Let one camera send to one subscriber that decodes; nothing else runs.

    Returns:
        What the subscriber reports, and the CPU (ms) of each process a frame.
    """
    with system() as running:
        running.camera(width, height, RATE_HZ)
        consumer = subprocess.Popen(
            [sys.executable, "-m", "benchmarks.consumer", running.endpoint, f"{count}", transport],
            stdout=subprocess.PIPE,
            text=True,
            env=running.environment("bench"),
        )
        if transport == "jpeg":
            first_frame(running)
        else:  # which would make the camera encode JPEG
            time.sleep(3)
        time.sleep(1)  # the warm-up of the consumer, whose frames do not count
        running.begin()
        begun_s = time.monotonic()
        out, _ = consumer.communicate(timeout=count / RATE_HZ + 60)
        frames = (time.monotonic() - begun_s) * RATE_HZ
        seen = json.loads(out)
        cpu = {name: used / frames * 1e3 for name, used in running.cpu_s().items()}
    cpu["subscriber"] = seen["cpu_s"] / count * 1e3
    return seen, cpu


def plain_stream(width: int, height: int, seconds: float, floor: Floor) -> dict[str, Any]:
    """One camera, one subscriber that decodes; nothing else runs."""
    seen, cpu = watched(width, height, int(seconds * RATE_HZ))
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
    with System() as system:
        system.camera(width, height, RATE_HZ)
        system.service("tracker", "tracker")
        system.service("edge", "edge")
        first_frame(system)
        watch = Watch(system)
        time.sleep(2)
        watch.ages_ms.clear()
        system.begin()
        time.sleep(seconds)
        cpu = system.cpu_s()
        ages = list(watch.ages_ms)
        watch.session.close()
    return {
        "centroid_ms": percentiles(ages),
        "centroids": len(ages),
        "of": int(seconds * RATE_HZ),
        "cpu_ms_per_frame": {
            name: round(value / (seconds * RATE_HZ) * 1e3, 3) for name, value in cpu.items()
        },
        "counters": {name: health.counters for name, health in watch.health.items()},
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
