"""Memory of each service by frame size: ``python -m benchmarks.memory [WIDTHxHEIGHT ...]``.

The synthetic camera, a tracker and an edge detector, with a subscriber for every picture that
they can make. Prints the most that each process held (VmHWM), in MB of 10^6 bytes.
"""

from __future__ import annotations

import sys
import threading
import time
from pathlib import Path
from typing import Any

from benchmarks.system import System
from zenoh_vision.transport.session import direct

SIZES = ("640x480", "1280x720", "1920x1080", "3840x2160")
RATE_HZ = 10
FRAMES = 100
PICTURES = ("image/compressed", "tracked/compressed", "mask/compressed", "edges/compressed")


def peak_mb(pid: int) -> float:
    """Return the peak memory of a process."""
    for line in Path(f"/proc/{pid}/status").read_text().splitlines():
        if line.startswith("VmHWM:"):
            return int(line.split()[1]) * 1024 / 1e6
    raise ValueError(f"no VmHWM of {pid}")


def measure(width: int, height: int, frames: int = FRAMES) -> dict[str, float]:
    """Return the peak memory of each process after ``frames`` centroids at this size."""
    with System() as system:
        session = system.session()
        enough = threading.Event()
        seen = 0

        def on_centroid(_: Any) -> None:
            nonlocal seen
            seen += 1
            if seen >= frames:
                enough.set()

        subscribers = [
            session.declare_subscriber(f"vision/front/{name}", direct(lambda _: None))
            for name in PICTURES
        ]
        subscribers.append(session.declare_subscriber("vision/front/centroid", direct(on_centroid)))
        system.service(
            "camera", "camera", f"--width={width}", f"--height={height}", f"--rate={RATE_HZ}"
        )
        for service in ("tracker", "edge"):
            system.service(service, service, f"--max-pixels={width * height}")
        if not enough.wait(60 + frames):
            raise SystemExit(f"{width}x{height}: {seen} of {frames} centroids")
        time.sleep(1)
        found = {name: peak_mb(process.pid) for name, process in system.processes.items()}
        del subscribers
        session.close()
    return found


def main() -> None:
    """Measure and print a Markdown table."""
    names = ("router", "camera", "tracker", "edge")
    print(f"| frame | {' | '.join(names)} |\n|---|{'---|' * len(names)}")
    for size in sys.argv[1:] or SIZES:
        width, height = map(int, size.split("x"))
        found = measure(width, height)
        print(f"| {size} | {' | '.join(f'{found[name]:.0f}' for name in names)} |", flush=True)


if __name__ == "__main__":
    main()
