"""Many cameras with trackers on this machine, and memory over a longer time."""

from __future__ import annotations

import time
from typing import Any

from benchmarks.stream import percentiles
from benchmarks.system import System, Watch
from zenoh_vision.messages import Diagnostics


def cameras(number: int, rate_hz: float, seconds: float, every_s: float = 10.0) -> dict[str, Any]:
    """Synthetic cameras of 640x480 with a tracker each: staleness, losses, memory.

    Args:
        number: Of cameras.
        rate_hz: Of each.
        seconds: How long to watch after the warm-up.
        every_s: How often memory is read.
    """
    with System() as system:
        for index, name in enumerate(f"c{index}" for index in range(number)):
            flags = ("--camera", name, "--rate", f"{rate_hz}", "--seed", f"{index}")
            system.service(f"camera_{name}", "camera", *flags)
            system.service(f"tracker_{name}", "tracker", "--camera", name)
        watch = Watch(system)
        while sum(name.startswith("tracker") for name in watch.health) < number:
            time.sleep(0.2)
        time.sleep(5)
        watch.ages_ms.clear()
        before = dict(watch.health)
        system.begin()
        memory = [system.memory_mb()]
        begun_s = time.monotonic()
        while time.monotonic() - begun_s < seconds:
            time.sleep(min(every_s, seconds))
            memory.append(system.memory_mb())
        elapsed_s = time.monotonic() - begun_s
        cpu = sum(system.cpu_s().values())
        ages = list(watch.ages_ms)
        watch.session.close()
    return {
        "cameras": number,
        "seconds": round(elapsed_s, 1),
        "centroids": len(ages),
        "of": int(elapsed_s * rate_hz * number),
        "age_ms": percentiles(ages) | {"max": round(max(ages), 1)},
        "older_than_400_ms": sum(age > 400 for age in ages),
        "dropped": dropped(before, watch.health),
        "cores_used": round(cpu / elapsed_s, 2),
        "memory_mb": {
            name: [round(memory[0][name], 1), round(memory[-1][name], 1)]
            for name in ("router", "camera_c0", "tracker_c0")
        },
    }


def dropped(before: dict[str, Diagnostics], after: dict[str, Diagnostics]) -> dict[str, int]:
    """Return how many frames the trackers dropped between two reports, by reason."""
    found: dict[str, int] = {}
    for name, health in after.items():
        if not name.startswith("tracker"):
            continue
        for counter, total in health.counters.items():
            earlier = before[name].counters.get(counter, 0) if name in before else 0
            if counter.startswith(("dropped.", "missed")) and total > earlier:
                found[counter] = found.get(counter, 0) + total - earlier
    return found
