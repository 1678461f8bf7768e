"""A system of containers as a user starts it, and the ways to break it."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import time
import uuid
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Self

from tests.support.routing import free_port, port_answers
from tests.support.waiting import wait_until

COMMAND_S = 900.0
"""A build on a small board, with nothing in its cache, takes minutes."""

IMAGE_TAG = "test"
IMAGE = f"zenoh-vision:{IMAGE_TAG}"
"""Not the tag that a user of this machine has deployed."""

START_S = 60.0
HANDSHAKE_MS = 300
"""Of a client on this machine: Docker's proxy takes connections also while the router is away."""

SERVICES = ("router", "camera", "tracker", "edge", "viewer")
OURS = ("camera", "tracker", "edge")
"""Of which each sends a stream of its camera."""


def compose_command() -> list[str] | None:
    """Return how this machine calls Compose: the plugin of Docker, or the older program."""
    if shutil.which("docker") is None:
        return None
    if not subprocess.run(
        ["docker", "compose", "version"], capture_output=True, check=False
    ).returncode:
        return ["docker", "compose"]
    return ["docker-compose"] if shutil.which("docker-compose") else None


def run(
    *words: object, cwd: Path | None = None, env: dict[str, str] | None = None, check: bool = True
) -> str:
    """Run a command and return its standard output; its error output is in the failure."""
    done = subprocess.run(
        [str(word) for word in words],
        capture_output=True,
        text=True,
        cwd=cwd,
        env=env,
        timeout=COMMAND_S,
        check=False,
    )
    assert not check or done.returncode == 0, f"{words}: {done.stdout}{done.stderr}"
    return done.stdout


def pause(seconds: float) -> None:
    """Let a fault last. Its length is what is tested; nothing is hoped for meanwhile."""
    time.sleep(max(0.0, seconds))


class Stack:
    """The containers of one Compose project, on a port of their own.

    Args:
        checkout: Folder of the compose files.
        overrides: Files to add: ``rest`` for configs/compose/rest.yml, or a path.
        settings: What a user writes into ``.env``.
        services: Which to start; all when empty.
    """

    def __init__(
        self,
        checkout: Path,
        overrides: Sequence[str | Path] = (),
        settings: dict[str, str] | None = None,
        services: Sequence[str] = (),
    ) -> None:
        self.checkout = checkout
        self.port = free_port()
        self.viewer_port = free_port()
        self.project = f"zvtest{uuid.uuid4().hex[:8]}"
        self._services = services
        self._files = [checkout / "docker-compose.yml"]
        for each in overrides:
            folder = checkout / "configs" / "compose"
            self._files.append(each if isinstance(each, Path) else folder / f"{each}.yml")
        kept = {name: value for name, value in os.environ.items() if not name.startswith("ZV_")}
        ports = {"ZV_PORT": str(self.port), "ZV_VIEWER_PORT": str(self.viewer_port)}
        self._env = {**kept, **ports, "ZV_IMAGE_TAG": IMAGE_TAG, **(settings or {})}

    def __enter__(self) -> Self:
        try:
            self.compose("up", "-d", "--no-build", *self._services)
        except BaseException:
            self.__exit__(None)
            raise
        return self

    def __exit__(self, kind: type[BaseException] | None, *error: object) -> None:
        """Show the end of the logs if something went wrong, and remove everything."""
        if kind is not None:
            print(self.compose("logs", "--no-color", "--tail", "40", check=False))
        self.compose("down", "-v", "-t", "3", check=False)

    @property
    def endpoint(self) -> str:
        """Where a client on this machine finds the router."""
        return f"tcp/127.0.0.1:{self.port}"

    def compose(self, *words: object, check: bool = True) -> str:
        command = compose_command()
        assert command is not None
        files = [part for file in self._files for part in ("-f", str(file))]
        words = (*command, "-p", self.project, *files, *words)
        return run(*words, cwd=self.checkout, env=self._env, check=check)

    # Containers

    def container(self, service: str) -> str:
        """Return the id of a service's container, running or not."""
        found = run(
            "docker", "ps", "-aq",
            "--filter", f"label=com.docker.compose.project={self.project}",
            "--filter", f"label=com.docker.compose.service={service}",
        ).split()  # fmt: skip
        assert len(found) == 1, f"{service}: {found}"
        return found[0]

    def inspect(self, service: str) -> dict[str, Any]:
        """Return what Docker knows of a service's container."""
        found: dict[str, Any] = json.loads(run("docker", "inspect", self.container(service)))[0]
        return found

    def health(self, service: str) -> str:
        """Return ``starting``, ``healthy`` or ``unhealthy``."""
        return str(self.inspect(service)["State"]["Health"]["Status"])

    def starts(self, service: str) -> tuple[str, int, str]:
        """Return what changes when a container is started again: its id, count, and time."""
        found = self.inspect(service)
        return found["Id"], found["RestartCount"], found["State"]["StartedAt"]

    def pid(self, service: str) -> int:
        """Return the number, on this machine, of the container's first process."""
        return int(self.inspect(service)["State"]["Pid"])

    def address(self, service: str) -> str:
        networks = self.inspect(service)["NetworkSettings"]["Networks"]
        return str(next(iter(networks.values()))["IPAddress"])

    def logs(self, service: str) -> str:
        return self.compose("logs", "--no-color", service)

    def resident_mb(self, service: str) -> float:
        """Return the memory of the container's processes, without files that are cached."""
        text = Path(f"/proc/{self.worker(service)}/status").read_text()
        return int(text.split("VmRSS:")[1].split()[0]) / 1024

    def worker(self, service: str) -> int:
        """Return the process that does the work: below init, and the router's shell."""
        found = self.pid(service)
        while children := Path(f"/proc/{found}/task/{found}/children").read_text().split():
            found = int(children[0])
        return found

    # Waiting

    def wait_until_healthy(self, *services: str) -> None:
        """Wait until each of them says that it does its work."""
        wanted = services or SERVICES
        wait_until(
            lambda: all(self.health(service) == "healthy" for service in wanted),
            START_S,
            lambda: str({service: self.health(service) for service in wanted}),
        )

    def router_answers(self) -> bool:
        """Tell whether the router's own port takes connections."""
        try:
            address = self.address("router")
        except AssertionError:
            return False
        return bool(address) and port_answers(7447, address)

    def wait_for_router(self, address: str | None = None) -> float:
        """Return the monotonic time at which the router's own port answers.

        Args:
            address: Where it is known to come back; else Docker is asked each time, which takes
                long beside the time that is to be measured.
        """
        wait_until(lambda: port_answers(7447, address) if address else self.router_answers(), 30)
        return time.monotonic()

    # Faults

    def crash(self, service: str) -> float:
        """Kill the process inside, as a crash does, and return the time at which it was dead.

        Not ``docker kill``: that is an order, after which no restart policy acts. A process that
        was killed still takes connections until its sockets are closed.
        """
        process = self.worker(service)
        os.kill(process, signal.SIGKILL)
        # Not until it is a zombie: its sockets are closed when its last thread has ended.
        wait_until(lambda: not Path(f"/proc/{process}").exists(), 10)
        return time.monotonic()

    def cut_off(self, service: str) -> None:
        run("docker", "network", "disconnect", self.network, self.container(service))

    @property
    def network(self) -> str:
        return f"{self.project}_default"

    def reconnect(self, service: str) -> None:
        """Put it back, under the name that others know."""
        run(
            "docker", "network", "connect", "--alias", service,
            self.network, self.container(service),
        )  # fmt: skip
