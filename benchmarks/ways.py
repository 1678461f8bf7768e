"""Measures capture to pixels through shared memory, raw and as JPEG, in turn, in one run."""

from __future__ import annotations

import json
import statistics
import subprocess
import sys
import time
from typing import Any

import numpy as np

from benchmarks.stream import RATE_HZ, first_frame, percentiles
from benchmarks.system import System

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
            seen, used = one_round(width, height, way, count)
            ages[way] += seen
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


def one_round(
    width: int, height: int, way: str, count: int
) -> tuple[list[float], dict[str, float]]:
    """Return ages (ms) of frames that came one way, and the CPU (ms) of each process a frame."""
    with System() as system:
        program = ("-m", "benchmarks.camera", f"{width}", f"{height}", f"{RATE_HZ}")
        system.start("camera", *program, system.endpoint)
        consumer = subprocess.Popen(
            [sys.executable, "-m", "benchmarks.consumer", system.endpoint, f"{count}", way],
            stdout=subprocess.PIPE,
            text=True,
        )
        if way == "jpeg":
            first_frame(system)
        else:  # which would make the camera encode JPEG
            time.sleep(3)
        time.sleep(1)  # the warm-up of the consumer, whose frames do not count
        system.begin()
        begun_s = time.monotonic()
        out, _ = consumer.communicate(timeout=count / RATE_HZ + 60)
        frames = (time.monotonic() - begun_s) * RATE_HZ
        seen = json.loads(out)
        cpu = {name: used / frames * 1e3 for name, used in system.cpu_s().items()}
    cpu["subscriber"] = seen["cpu_s"] / count * 1e3
    return seen["ages_ms"], cpu
