"""A subscriber in a container of its own, behind a link that can be made worse."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Self

from tests.support.containers.stack import IMAGE, Stack, run
from tests.support.containers.witness import Seen
from tests.support.waiting import wait_until

PROGRAM = Path(__file__).with_name("listener.py")


class FarSubscriber:
    """A plain Zenoh subscriber on a stack's network.

    Args:
        stack: Whose router it reads from.
        keys: What it subscribes to.
    """

    def __init__(self, stack: Stack, keys: list[str]) -> None:
        self.container = run(
            "docker", "run", "-d", "--network", stack.network, "--init",
            "-v", f"{PROGRAM}:/listener.py:ro", "--entrypoint", "python", IMAGE,
            "/listener.py", "tcp/router:7447", *keys,
        ).strip()  # fmt: skip

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        """Remove the container, and its link with it."""
        run("docker", "rm", "-f", self.container)

    @property
    def pid(self) -> str:
        return run("docker", "inspect", "-f", "{{.State.Pid}}", self.container).strip()

    def slow_down(self, rate: str) -> None:
        """Limit what it can receive, where its link leaves the bridge.

        Only the end of this container's own veth pair is ever touched.
        """
        name = run("nsenter", "-t", self.pid, "-n", "ip", "-o", "link", "show", "eth0")
        peer = re.search(r"eth0@if(\d+)", name)
        assert peer, name
        links = run("ip", "-o", "link", "show", "type", "veth")
        found = re.search(rf"^{peer[1]}: (veth\w+)@", links, re.MULTILINE)
        assert found, links
        run(
            "tc", "qdisc", "add", "dev", found[1], "root",
            "tbf", "rate", rate, "burst", "32kbit", "latency", "50ms",
        )  # fmt: skip

    def lose(self, share: float) -> None:
        """Drop this share of the packets that come in."""
        run(
            "nsenter", "-t", self.pid, "-n", "iptables", "-A", "INPUT", "-p", "tcp",
            "-m", "statistic", "--mode", "random", "--probability", share, "-j", "DROP",
        )  # fmt: skip

    def arrivals(self, key: str) -> list[Seen]:
        """Return what came on a key so far."""
        return [
            Seen(line["epoch"], line["seq"], line["stamp_ns"], line["at_ns"] / 1e9, line["at_ns"])
            for line in self.lines()
            if line["key"] == key
        ]

    def lines(self) -> list[dict[str, int]]:
        return [
            json.loads(line) for line in run("docker", "logs", self.container).splitlines() if line
        ]

    def wait_for(self, count: int) -> None:
        wait_until(lambda: len(self.lines()) >= count, 30)
