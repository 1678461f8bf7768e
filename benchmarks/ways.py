"""Measures capture to pixels through shared memory, raw and as JPEG, in turn, in one run."""

from __future__ import annotations

import statistics
import time
from typing import Any

import numpy as np

from benchmarks.stream import RATE_HZ, percentiles, watched

WAYS = ("shm", "raw", "jpeg")
ROUNDS = 3


def measure(width: int, height: int, seconds: float) -> dict[str, Any]:
    """Return latency and CPU per frame of each way, and its ratio to copying the frame once."""
    count = max(30, int(seconds * RATE_HZ / ROUNDS))
    ages: dict[str, list[float]] = {way: [] for way in WAYS}
    cpu: dict[str, list[dict[str, float]]] = {way: [] for way in WAYS}
    copies: list[float] = []
    for _ in range(ROUNDS):
        copies += copying_ms(width, height)
        for way in WAYS:
            seen, used = watched(width, height, count, way)
            ages[way] += seen["ages_ms"]
            cpu[way].append(used)
    copy_ms = statistics.median(copies)
    found: dict[str, Any] = {"copy_ms": round(copy_ms, 3)}
    for way in WAYS:
        used = {name: statistics.mean(each[name] for each in cpu[way]) for name in cpu[way][0]}
        latency = percentiles(ages[way])
        found[way] = {
            "latency_ms": latency,
            "latency_copies": round(latency["p50"] / copy_ms, 2),
            "cpu_ms_per_frame": {name: round(value, 3) for name, value in used.items()},
            "cpu_copies": round(sum(used.values()) / copy_ms, 2),
        }
    return found


def copying_ms(width: int, height: int) -> list[float]:
    """Return the milliseconds of copying a frame in memory: CPU time, paced as the frames are."""
    picture, target = (np.ones((height, width, 3), np.uint8) for _ in range(2))
    found = []
    for _ in range(20):
        time.sleep(1 / RATE_HZ)
        begun_s = time.thread_time()
        np.copyto(target, picture)
        found.append((time.thread_time() - begun_s) * 1e3)
    return found
