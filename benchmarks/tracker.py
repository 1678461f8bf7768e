"""Measures the CPU time of the tracker's pipelines, and the rate with four large cameras."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import numpy as np

from benchmarks.fleet import dropped
from benchmarks.material import video
from benchmarks.quality.tracker.baselines import Tutorial
from benchmarks.stream import percentiles
from benchmarks.system import System, Watch
from zenoh_vision.host.allocator import keep_freed_memory
from zenoh_vision.image.codecs import decode_jpeg, encode_jpeg

SIZE = (768, 576)
RATE_HZ = 10.0
QUALITY = 80
WARM_UP = 20
CAMERAS = 4
WIDTH, HEIGHT, CAMERA_RATE_HZ = 1920, 1080, 30.0


def cpu_beside_tutorial(seconds: float) -> dict[str, Any]:
    """Return the CPU time of both pipelines on the same JPEGs of 768x576, decoding included.

    They take each frame in turn. OpenCV uses one thread (``benchmarks.__main__``), so the thread's
    time is the whole CPU time. Freed memory is kept, as ``zv tracker`` does.
    """
    from zv.tracker.pipelines.base import working_scale
    from zv.tracker.pipelines.robust import RobustTracker

    keep_freed_memory()
    jpegs = [encode_jpeg(bgr, "bgr8", QUALITY) for bgr in video(*SIZE)]
    tutorial, robust = Tutorial(), RobustTracker()

    def with_tutorial(jpeg: bytes, _: int) -> None:
        tutorial.update(decode_jpeg(jpeg, "bgr8"))

    def with_robust(jpeg: bytes, stamp_ns: int) -> None:
        scale = working_scale(*SIZE)
        least = -(-SIZE[0] // scale), -(-SIZE[1] // scale)
        robust.update(decode_jpeg(jpeg, "bgr8", least), stamp_ns, SIZE)

    runs: dict[str, Callable[[bytes, int], None]] = {
        "tutorial": with_tutorial,
        "robust": with_robust,
    }
    spent: dict[str, list[float]] = {name: [] for name in runs}
    end_s = time.monotonic() + seconds
    for index, jpeg in enumerate(jpegs):
        for name, run in runs.items():
            begun_s = time.thread_time()
            run(jpeg, round(index * 1e9 / RATE_HZ))
            spent[name].append((time.thread_time() - begun_s) * 1e3)
        if time.monotonic() > end_s and index > 2 * WARM_UP:
            break
    mean = {name: float(np.mean(times[WARM_UP:])) for name, times in spent.items()}
    return {
        "frames": len(spent["robust"]) - WARM_UP,
        "cpu_ms": {name: round(value, 3) for name, value in mean.items()},
        "cpu_ms_p50_p99": {name: percentiles(times[WARM_UP:]) for name, times in spent.items()},
        "ratio": round(mean["robust"] / mean["tutorial"], 3),
    }


def large_cameras(
    seconds: float, pipeline: str = "robust", *, edges: bool = False
) -> dict[str, Any]:
    """Return the rate of each of four trackers, each with a camera of 1920x1080 at 30 Hz.

    Args:
        seconds: Duration.
        pipeline: Of the trackers.
        edges: Whether each camera has an edge detector too, whose edges nobody subscribes to.
    """
    names = [f"c{index}" for index in range(CAMERAS)]
    with System() as system:
        for name in names:
            system.camera(WIDTH, HEIGHT, CAMERA_RATE_HZ, name)
            system.service(f"tracker_{name}", "tracker", "--camera", name, "--pipeline", pipeline)
            if edges:
                system.service(f"edge_{name}", "edge", "--camera", name)
        watch = Watch(system)
        while not all(watch.counts[name] for name in names):
            time.sleep(0.2)
        time.sleep(5)
        before, begun = dict(watch.health), dict(watch.counts)
        system.begin()
        begun_s = time.monotonic()
        time.sleep(seconds)
        elapsed_s = time.monotonic() - begun_s
        rates = [(watch.counts[name] - begun[name]) / elapsed_s for name in names]
        cpu = system.cpu_s()
        watch.session.close()
    return {
        "pipeline": pipeline,
        "edges": edges,
        "hz": [round(rate, 1) for rate in rates],
        "slowest_hz": round(min(rates), 1),
        "cores_used": round(sum(cpu.values()) / elapsed_s, 2),
        "cores_of": {
            kind: round(
                sum(used for name, used in cpu.items() if name.startswith(kind)) / elapsed_s, 2
            )
            for kind in ("router", "camera", "tracker", "edge")
        },
        "dropped": dropped(before, watch.health),
    }
