"""Two sites in network namespaces of this machine, with a slow link between them."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from contextlib import ExitStack
from pathlib import Path
from typing import Self

from tests.support.processes import ROOT, STOP_S, environment
from tests.support.waiting import wait_until

HERE, THERE = "10.231.7.1", "10.231.7.2"
ENDPOINT = "tcp/127.0.0.1:7447"


def ip(*words: str) -> None:
    subprocess.run(["ip", *words], check=True, capture_output=True, timeout=10)


class TwoSites:
    """A site with a router and a camera, and one with a router that is linked to it.

    Every program ends with the context, and so do the namespaces. The rate of the link is in the
    words of ``tc``: ``1mbit``.
    """

    def __init__(self, folder: Path, rate: str) -> None:
        self._folder = folder
        self._rate = rate
        self._here, self._there = f"zv-here-{os.getpid()}", f"zv-there-{os.getpid()}"
        self._ending = ExitStack()

    def __enter__(self) -> Self:
        with ExitStack() as building:
            for name in (self._here, self._there):
                ip("netns", "add", name)
                building.callback(ip, "netns", "del", name)
                ip("-n", name, "link", "set", "lo", "up")
            ip("link", "add", "wan", "netns", self._here, "type", "veth",
               "peer", "name", "wan", "netns", self._there)  # fmt: skip
            for name, address in ((self._here, HERE), (self._there, THERE)):
                ip("-n", name, "address", "add", f"{address}/24", "dev", "wan")
                ip("-n", name, "link", "set", "wan", "up")
                ip("netns", "exec", name, "tc", "qdisc", "add", "dev", "wan", "root",
                   "tbf", "rate", self._rate, "burst", "32kbit", "latency", "50ms")  # fmt: skip
            self._ending = building.pop_all()
        listens = "tcp/0.0.0.0:7447#so_sndbuf=32768"
        self.start("here", "router", ["-m", "zv", "router", "--listen", listens])
        linked = self._folder / "there.json5"
        linked.write_text(json.dumps({"connect": {"endpoints": [f"tcp/{HERE}:7447"]}}))
        self.start(
            "there",
            "router",
            ["-m", "zv", "router", "--listen", ENDPOINT, "--zenoh-config", linked],
        )
        for site in ("here", "there"):
            self.wait_for_port(site, 7447)
        return self

    def __exit__(self, *error: object) -> None:
        """End every program, and remove the namespaces."""
        self._ending.close()

    def start(self, site: str, name: str, arguments: list[str | Path], **variables: str) -> Path:
        """Start a Python program at ``here`` or ``there``; return the file of its output.

        Shared memory is left out: it would lead past the link.
        """
        namespace = self._here if site == "here" else self._there
        output = self._folder / f"{name}-{site}.out"
        with output.open("wb") as out, output.with_suffix(".err").open("wb") as err:
            process = subprocess.Popen(
                ["ip", "netns", "exec", namespace, sys.executable, *map(str, arguments)],
                stdin=subprocess.DEVNULL,
                stdout=out,
                stderr=err,
                cwd=ROOT,
                env=environment() | {"ZV_CONNECT": ENDPOINT, "ZV_TRANSPORT": "jpeg"} | variables,
            )
        self._ending.callback(process.wait, STOP_S)
        self._ending.callback(process.terminate)  # ``ip netns exec`` becomes the program
        return output

    def wait_for_port(self, site: str, port: int) -> None:
        """Wait until something listens on a port of a site."""
        namespace = self._here if site == "here" else self._there
        asked = ["ip", "netns", "exec", namespace, "ss", "-ltnH", f"sport = :{port}"]
        wait_until(lambda: subprocess.run(asked, capture_output=True, timeout=10).stdout, 60)

    def lines(self, output: Path, count: int, deadline_s: float) -> list[str]:
        """Return the complete lines of an output, when there are enough."""

        def complete() -> list[str]:
            return output.read_text().rpartition("\n")[0].splitlines()

        wait_until(
            lambda: len(complete()) >= count,
            deadline_s,
            lambda: f"{len(complete())} lines; " + output.with_suffix(".err").read_text()[-1000:],
        )
        return complete()
