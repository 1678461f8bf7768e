"""Measures one system after the other, or one that grows, and what each kind of process costs."""

from __future__ import annotations

import json
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.system import System
from zenoh_vision.messages import Diagnostics
from zenoh_vision.transport.session import direct

NUMBERS = (1, 2, 4, 8, 16, 32)
SIZES = ((160, 120), (320, 240), (640, 480), (1280, 720), (1920, 1080), (3840, 2160))
SMALL = (160, 120)
"""Of each of many cameras."""
MEDIUM = (320, 240)
"""Of the camera with many subscribers."""
RATE_HZ = 10.0
SETTLE_S = 1.5
START_S = 90.0
REPORT_S = 30.0
SHARE = 1 / 2
"""Of the seconds of other measurements, for each point: with the starts four minutes in all."""


@dataclass(frozen=True, slots=True)
class Point:
    """What was measured at one amount of work.

    Attributes:
        work: Number of cameras, of subscribers, or of pixels.
        cpu_ms: CPU time of all processes of each kind, by its name: ms a second where their number
            grows, ms a frame where the frame does.
        p50_ms: Age of frames when their pixels are decoded, median.
        p99_ms: 99th percentile of the ages.
        share: Of the frames that were due, how many were decoded.
    """

    work: int
    cpu_ms: dict[str, float]
    p50_ms: float
    p99_ms: float
    share: float


@dataclass(frozen=True, slots=True)
class _Window:
    """A measured time, CPU seconds of each kind of process in it, and the frames that were due."""

    work: int
    begun_ns: int
    ended_ns: int
    cpu_s: dict[str, float]
    due: float


class _Growing:
    """A system whose processes are added, and the times in which it was measured."""

    def __init__(self, system: System, folder: Path, seconds: float) -> None:
        self._system = system
        self._folder = folder
        self._seconds = seconds
        self._nodes: set[str] = set()
        self._windows: list[_Window] = []

    def camera(self, name: str, size: tuple[int, int]) -> None:
        """Start a camera whose pictures come from memory."""
        arguments = [*map(str, (*size, RATE_HZ)), self._system.endpoint, name]
        self._system.start(f"camera {name}", "-m", "benchmarks.camera", *arguments)
        self._nodes.add(f"camera_{name}")

    def subscriber(self, name: str, camera: str) -> None:
        """Start a process that decodes the frames of a camera, or of all."""
        arguments = [self._system.endpoint, name, camera, str(self._folder / name)]
        self._system.start(f"subscriber {name}", "-m", "benchmarks.growth.subscriber", *arguments)
        self._nodes.add(name)

    def viewer(self) -> None:
        """Start a viewer that no page is open at: it watches all nodes and streams."""
        self._system.service("viewer", "view", "--port", "0")

    def measure(self, work: int, frames_hz: float) -> None:
        """Measure once every process works.

        Args:
            work: The amount of it.
            frames_hz: How many frames all subscribers together should decode in a second.
        """
        self._wait_until_all_work()
        time.sleep(SETTLE_S)
        self._system.begin()
        begun_ns = time.time_ns()
        time.sleep(self._seconds)
        cpu_s: dict[str, float] = {}
        for name, used_s in self._system.cpu_s().items():
            kind = name.partition(" ")[0]
            cpu_s[kind] = cpu_s.get(kind, 0.0) + used_s
        ended_ns = time.time_ns()
        due = frames_hz * (ended_ns - begun_ns) / 1e9
        self._windows.append(_Window(work, begun_ns, ended_ns, cpu_s, due))
        print(f"# growth: measured {work}", flush=True)

    def end_subscribers(self) -> None:
        """Tell all subscribers to report, and wait until they have."""
        names = [name for name in self._system.processes if name.startswith("subscriber ")]
        ending = [self._system.processes.pop(name) for name in names]
        for process in ending:
            process.terminate()
        for process in ending:
            process.wait(REPORT_S)

    def points(self, *, per_frame: bool = False) -> list[Point]:
        """Return what was measured, after the subscribers have ended."""
        files = [path for path in self._folder.iterdir() if path.is_file()]
        reports = [np.array(json.loads(path.read_text())) for path in files]
        found = np.concatenate(reports, axis=1)
        return [_point(window, found, per_frame=per_frame) for window in self._windows]

    def _wait_until_all_work(self) -> None:
        """Wait until each node has published or processed a frame, by its diagnostics.

        Raises:
            SystemExit: Not all did in time.
        """
        idle = set(self._nodes)

        def note(sample: Any) -> None:
            report = Diagnostics.from_bytes(sample.payload.to_bytes())
            if report.counters.get("published", 0) + report.counters.get("processed", 0):
                idle.discard(report.node)

        session = self._system.session()
        subscriber = session.declare_subscriber("@vision/diagnostics/*", direct(note))
        deadline_s = time.monotonic() + START_S
        while idle:
            if time.monotonic() > deadline_s:
                raise SystemExit(f"no frames within {START_S:g} s: {', '.join(sorted(idle))}")
            time.sleep(0.05)
        subscriber.undeclare()
        session.close()


def _point(window: _Window, found: np.ndarray[Any, Any], *, per_frame: bool) -> Point:
    decoded_ns, ages_ms = found
    ages_ms = ages_ms[(decoded_ns >= window.begun_ns) & (decoded_ns < window.ended_ns)]
    if not len(ages_ms):
        raise SystemExit(f"no frames arrived at {window.work}")
    seconds = (window.ended_ns - window.begun_ns) / 1e9
    units = len(ages_ms) if per_frame else seconds
    return Point(
        window.work,
        {kind: used_s / units * 1e3 for kind, used_s in sorted(window.cpu_s.items())},
        float(np.percentile(ages_ms, 50)),
        float(np.percentile(ages_ms, 99)),
        len(ages_ms) / window.due,
    )


def of_cameras(seconds: float, numbers: Sequence[int] = NUMBERS) -> list[Point]:
    """Measure ever more cameras, one service that decodes the frames of all, and a viewer."""

    def run(growing: _Growing) -> None:
        growing.viewer()
        growing.subscriber("service", "*")
        for before, number in zip((0, *numbers), numbers, strict=False):
            for index in range(before, number):
                growing.camera(f"c{index}", SMALL)
            growing.measure(number, number * RATE_HZ)

    return _grown(run, seconds)


def of_subscribers(seconds: float, numbers: Sequence[int] = NUMBERS) -> list[Point]:
    """Measure one camera and ever more services that each decode its frames."""

    def run(growing: _Growing) -> None:
        growing.camera("front", MEDIUM)
        for before, number in zip((0, *numbers), numbers, strict=False):
            for index in range(before, number):
                growing.subscriber(f"service_{index}", "front")
            growing.measure(number, number * RATE_HZ)

    return _grown(run, seconds)


def of_pixels(seconds: float, sizes: Sequence[tuple[int, int]] = SIZES) -> list[Point]:
    """Measure one camera and one service that decodes its frames, for each size in turn."""
    found = []
    for size in sizes:

        def run(growing: _Growing, size: tuple[int, int] = size) -> None:
            growing.camera("front", size)
            growing.subscriber("service", "front")
            growing.measure(size[0] * size[1], RATE_HZ)

        found += _grown(run, seconds, per_frame=True)
    return found


def _grown(
    run: Callable[[_Growing], None], seconds: float, *, per_frame: bool = False
) -> list[Point]:
    with tempfile.TemporaryDirectory() as folder:
        with System() as system:
            growing = _Growing(system, Path(folder), seconds)
            run(growing)
            growing.end_subscribers()
        return growing.points(per_frame=per_frame)
