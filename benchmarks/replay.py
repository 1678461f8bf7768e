"""Measures how exactly a recording is played, and how fast a tracker is verified on one core."""

from __future__ import annotations

import json
import os
import resource
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import msgpack

from benchmarks.material import frames
from benchmarks.system import System
from zenoh_vision.image.codecs import encode_jpeg
from zenoh_vision.keys import JPEG
from zv.bag.record import Record
from zv.bag.writer import Writer

WIDTH, HEIGHT, RATE_HZ = 768, 576, 30.0
QUALITY = 80
BEGIN_NS = 1_750_000_000_000_000_000


def verified(seconds: float) -> dict[str, Any]:
    """Verify a tracker on a recording of 768x576 at 30 Hz, all processes on one core.

    ``speed`` is recorded seconds in a second, from the first frame to the last; ``cpu_speed`` the
    same by the CPU time of all processes, which depends less on what else the machine does: that of
    this recording less that of one of a second.
    """
    (few, few_s, _), (many, many_s, speed) = _verified(1.0), _verified(seconds)
    per_frame_s = (many_s - few_s) / (many - few)
    return {
        "frames": many,
        "speed": speed,
        "cpu_speed": round(1 / RATE_HZ / per_frame_s, 2),
        "cpu_ms_per_frame": round(1000 * per_frame_s, 2),
        "cpu_s_of_start": round(few_s - few * per_frame_s, 2),
    }


def _verified(seconds: float) -> tuple[int, float, float]:
    """Return the number of frames, the CPU seconds of all processes, and the speed."""
    with TemporaryDirectory() as folder:
        run, golden = Path(folder, "run.mcap"), Path(folder, "golden.mcap")
        _record(run, seconds)
        _zv("bag", "verify", str(run), "--node", "tracker", "--update", str(golden))
        core = min(os.sched_getaffinity(0))
        before_s = _children_s()
        said = _zv("bag", "verify", str(golden), "--node", "tracker", "--json", core=core)
        spent_s = _children_s() - before_s
    found = json.loads(said)
    return found["frames"], spent_s, found["speed"]


def played(seconds: float) -> dict[str, Any]:
    """Play a recording of 768x576 at 30 Hz to a tracker; return how far from due it was sent."""
    with TemporaryDirectory() as folder, System() as system:
        run = Path(folder, "run.mcap")
        _record(run, seconds)
        system.service("tracker", "tracker", "--camera", "front")
        time.sleep(2.0)
        said = _zv("bag", "play", str(run), "--json", "--connect", system.endpoint)
    found = json.loads(said)
    return {"samples": found["samples"], "deviation_ms": found["deviation_ms"]}


def _record(path: Path, seconds: float) -> None:
    jpegs = [encode_jpeg(bgr, "bgr8", QUALITY) for bgr in frames(WIDTH, HEIGHT)]
    writer = Writer(path, {"namespace": "vision"})
    for seq in range(round(seconds * RATE_HZ)):
        stamp_ns = BEGIN_NS + round(seq * 1e9 / RATE_HZ)
        header = {"camera": "front", "epoch": BEGIN_NS, "seq": seq, "stamp_ns": stamp_ns}
        header |= {"width": WIDTH, "height": HEIGHT, "encoding": "bgr8", "node": "camera_front"}
        key, jpeg = "vision/front/image/compressed", jpegs[seq % len(jpegs)]
        writer.add(Record(key, jpeg, JPEG, msgpack.packb(header), log_time_ns=stamp_ns))
    writer.close()


def _zv(*arguments: str, core: int | None = None) -> str:
    command: Sequence[str] = [sys.executable, "-m", "zv", *arguments]
    on_core = None if core is None else lambda: os.sched_setaffinity(0, {core})
    done = subprocess.run(command, check=True, capture_output=True, text=True, preexec_fn=on_core)
    return done.stdout


def _children_s() -> float:
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime
