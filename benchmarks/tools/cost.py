"""Measures the tools: CPU compared with a bare subscriber; the time of a snapshot."""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path
from typing import Any

import psutil

from benchmarks.stream import percentiles
from benchmarks.system import System
from zenoh_vision.transport.session import direct

STREAMS = 20
SETTLE_S = 3.0
PICTURES = "vision/*/image/compressed"
CENTROIDS = "vision/*/centroid"
HEALTH = "@vision/diagnostics/*"


def cpu_beside_bare(width: int, height: int, rate_hz: float, seconds: float) -> dict[str, Any]:
    """CPU of tools on many streams of pictures, and of a program that only subscribes.

    Returns:
        Percent of a core by tool, and its ratio to the bare subscriber.
    """
    with System() as system:
        numbers = [f"{STREAMS}", f"{width}", f"{height}", f"{rate_hz:g}"]
        system.start("streams", "-m", "benchmarks.tools.many_streams", system.endpoint, *numbers)
        wait_for(system, f"vision/c{STREAMS - 1}/image/compressed")
        found = {"bare": measured(bare(system, PICTURES), seconds)}
        for tool in ("hz", "bw", "delay"):
            found[tool] = measured(zv(system, "topic", tool, PICTURES), seconds)
        found["list --watch"] = measured(zv(system, "topic", "list", "--watch"), seconds)
        seen = rates(system, seconds)
    return _with_ratios(found) | {"streams": STREAMS, "rate_hz": rate_hz, "seen": seen}


def rates(system: System, seconds: float) -> dict[str, Any]:
    """Return the rates by ``zv topic hz``, to check that the tool misses no samples."""
    words = zv(system, "topic", "hz", PICTURES, "--json", "--for", f"{seconds:g}")
    done = subprocess.run([sys.executable, *words], capture_output=True, check=True, text=True)
    found = [json.loads(line) for line in done.stdout.splitlines()]
    return {
        "streams": len(found),
        "slowest_hz": round(min(each["rate_hz"] for each in found), 2),
        "messages": sum(each["messages"] for each in found),
        "lost": sum(each["lost"] for each in found),
    }


def cpu_of_echo(seconds: float) -> dict[str, Any]:
    """CPU of printing one camera's centroids, beside a program that only subscribes to them."""
    with System() as system:
        system.service("camera", "camera")
        system.service("tracker", "tracker")
        wait_for(system, "vision/front/centroid")
        found = {"bare": measured(bare(system, CENTROIDS), seconds)}
        for form in ([], ["--json"], ["--csv"]):
            name = " ".join(["echo", *form])
            found[name] = measured(zv(system, "topic", "echo", CENTROIDS, *form), seconds)
    return _with_ratios(found)


def cpu_of_watching(seconds: float) -> dict[str, Any]:
    """CPU of watching four nodes, beside a program that only subscribes to their health."""
    with System() as system:
        for name in ("camera", "tracker", "edge"):
            system.service(name, name)
        system.service("other", "tracker", "--camera", "other")
        wait_for(system, "vision/front/centroid")
        found = {"bare": measured(bare(system, HEALTH), seconds)}
        for words in (("top",), ("top", "--json"), ("node", "list", "--watch")):
            found[" ".join(words)] = measured(zv(system, *words), seconds)
    return _with_ratios(found)


def snapshot(times: int = 10) -> dict[str, Any]:
    """Seconds from starting ``zv snapshot`` to its end, the file being written."""
    with System() as system, tempfile.TemporaryDirectory() as folder:
        system.service("camera", "camera")
        system.service("tracker", "tracker")
        wait_for(system, "vision/front/centroid")
        found = {}
        for name, key, *flags in (
            ("as it comes", "vision/front/image/compressed", "-o", "a.jpg"),
            ("raw to PNG", "vision/front/image", "-o", "b.png"),
            ("with --draw", "vision/front/image/compressed", "--draw", "-o", "c.jpg"),
        ):
            taken = []
            for _ in range(times):
                begun_s = time.monotonic()
                command = [sys.executable, "-m", "zv", "snapshot", key]
                options = ["--connect", system.endpoint, *flags]
                subprocess.run(
                    [*command, *options],
                    cwd=folder,
                    check=True,
                    stderr=subprocess.DEVNULL,
                )
                taken.append(time.monotonic() - begun_s)
                (Path(folder) / flags[-1]).unlink()
            found[name] = percentiles(taken)
    return found


def wait_for(system: System, key: str) -> None:
    """Wait until something flows on a key."""
    session = system.session()
    arrived = threading.Event()
    session.declare_subscriber(key, direct(lambda _: arrived.set()))
    if not arrived.wait(60):
        raise SystemExit(f"nothing on {key} within 60 s")
    session.close()


def bare(system: System, key: str) -> list[str]:
    """Return the command of a program that only subscribes."""
    return ["-m", "benchmarks.tools.bare_subscriber", system.endpoint, key]


def zv(system: System, *words: str) -> list[str]:
    """Return the command of a tool."""
    return ["-m", "zv", *words, "--connect", system.endpoint]


def measured(command: list[str], seconds: float) -> float:
    """Return the CPU of a program, percent of a core, once it has settled."""
    process = psutil.Popen(
        [sys.executable, *command], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    )
    try:
        time.sleep(SETTLE_S)
        before = process.cpu_times()
        begun_s = time.monotonic()
        time.sleep(seconds)
        after = process.cpu_times()
        used_s = after.user + after.system - before.user - before.system
        return float(100 * used_s / (time.monotonic() - begun_s))
    finally:
        process.terminate()
        process.wait(5)


def _with_ratios(found: dict[str, float]) -> dict[str, Any]:
    return {
        "percent_of_a_core": {name: round(value, 1) for name, value in found.items()},
        "ratio_to_bare": {
            name: round(value / found["bare"], 2) for name, value in found.items() if name != "bare"
        },
    }
