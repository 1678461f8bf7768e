"""Measures what certificates and encryption cost: frames by TLS and by TCP, in turn, in one run."""

from __future__ import annotations

import json
import os
import statistics
import subprocess
import sys
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Self

from benchmarks.stream import RATE_HZ, percentiles, watched
from benchmarks.system import CREDENTIALS, System, free_endpoint
from zenoh_vision.transport.connection import Connection

ROUNDS = 3
OWNERS = {"camera": "camera_front", "bench": "bench_front"}
"""Whose credentials each process of ``System`` has; all others have a guest's."""


class SecureSystem(System):
    """A system whose router asks for certificates, and whose processes have them."""

    def __init__(self) -> None:
        super().__init__()
        port = free_endpoint().rpartition(":")[2]
        self.endpoint = f"tls/127.0.0.1:{port}"
        self._place = tempfile.TemporaryDirectory()
        self._folder = Path(self._place.name) / "security"
        self._zv("init", str(self._folder), "--port", port)
        consumes = ("--subscribes", "vision/front/image/compressed")
        self._zv("add", "--dir", str(self._folder), "--node", "bench_front", *consumes)

    def __enter__(self) -> Self:
        self.start("router", "-m", "zv", "router", "--credentials", str(self._folder / "router"))
        self.session().close()
        return self

    def __exit__(self, *error: object) -> None:
        super().__exit__(*error)
        self.forget()

    def forget(self) -> None:
        """Delete the certificates."""
        self._place.cleanup()

    def router_file(self) -> dict[str, Any]:
        """Return the configuration of the router."""
        _, _, text = (self._folder / "router" / "router.json5").read_text().partition("\n")
        found: dict[str, Any] = json.loads(text)
        return found

    def connection(self) -> Connection:
        """Return the connection of a guest."""
        return Connection(self.endpoint, credentials=str(self._folder / "guest"), timeout_s=60)

    def environment(self, name: str) -> Mapping[str, str]:
        """Return the environment of a process, with its credentials."""
        if name == "router":
            return os.environ
        return {**os.environ, CREDENTIALS: str(self._folder / OWNERS.get(name, "guest"))}

    @staticmethod
    def _zv(*words: str) -> None:
        command = [sys.executable, "-m", "zv", "security", *words]
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL)


class PlainSystem(System):
    """A system without certificates, whose router has the same queues and buffers."""

    def __enter__(self) -> Self:
        secure = SecureSystem()
        content = secure.router_file()
        secure.forget()
        for name in ("access_control", "low_pass_filter", "downsampling"):
            del content[name]
        for name in ("tls", "protocols"):
            del content["transport"]["link"][name]
        _, _, options = content["listen"]["endpoints"][0].partition("#")
        content["listen"]["endpoints"] = [f"{self.endpoint}#{options}"]
        self._file = tempfile.NamedTemporaryFile("w", suffix=".json5")
        json.dump(content, self._file)
        self._file.flush()
        self.start("router", "-m", "zv", "router", "--zenoh-config", self._file.name)
        self.session().close()
        return self

    def __exit__(self, *error: object) -> None:
        super().__exit__(*error)
        self._file.close()


def measure(width: int, height: int, seconds: float) -> dict[str, Any]:
    """Return latency and CPU per frame by TCP and by TLS, and what TLS adds."""
    count = max(30, int(seconds * RATE_HZ / ROUNDS))
    ways: dict[str, type[System]] = {"tcp": PlainSystem, "tls": SecureSystem}
    ages: dict[str, list[float]] = {way: [] for way in ways}
    cpu: dict[str, list[dict[str, float]]] = {way: [] for way in ways}
    for _ in range(ROUNDS):
        for way, system in ways.items():
            seen, used = watched(width, height, count, system=system)
            ages[way] += seen["ages_ms"]
            cpu[way].append(used)
    found: dict[str, Any] = {}
    spent, median = {}, {}
    for way in ways:
        used = {name: statistics.mean(each[name] for each in cpu[way]) for name in cpu[way][0]}
        spent[way], median[way] = sum(used.values()), statistics.median(ages[way])
        found[way] = {
            "latency_ms": percentiles(ages[way]),
            "cpu_ms_per_frame": {name: round(value, 3) for name, value in used.items()},
        }
    found["tls_adds_ms"] = round(median["tls"] - median["tcp"], 3)
    found["tls_adds_cpu_percent"] = round(100 * (spent["tls"] / spent["tcp"] - 1), 1)
    return found
