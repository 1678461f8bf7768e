"""Systems with certificates: a folder of ``zv security``, routers that use it, and its clients."""

from __future__ import annotations

import io
import json
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager, redirect_stdout
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import zenoh

from tests.support.fork_server import ZV
from tests.support.processes import Program
from tests.support.routing import free_port, port_answers, zenohd
from tests.support.waiting import wait_until
from zenoh_vision.security.rights import TO_ROUTER as TO_ROUTER
from zenoh_vision.transport.connection import Connection
from zenoh_vision.transport.zenoh_config import client_config
from zv.tools.security import commands
from zv.tools.security.options import AddOptions, InitOptions, RenewOptions, RevokeOptions
from zv.tools.shared.output import Output


@dataclass(frozen=True)
class Secured:
    """A folder of certificates, and the port of its router."""

    folder: Path
    port: int

    @property
    def endpoint(self) -> str:
        return f"tls/127.0.0.1:{self.port}"

    def connection(self, name: str, **changes: Any) -> Connection:
        given = {"connect": self.endpoint, "timeout_s": 20.0, **changes}
        return Connection(credentials=str(self.folder / name), **given)

    def client(self, name: str, port: int | None = None) -> zenoh.Session:
        """Open a session as somebody of the folder."""
        where = self.endpoint if port is None else f"tls/127.0.0.1:{port}"
        return zenoh.open(client_config(self.connection(name, connect=where)))

    def witness(self, port: int | None = None) -> zenoh.Session:
        """Open a session that may do everything in the namespace: as a router."""
        config = zenoh.Config()
        tls = self.content("router")["transport"]["link"]["tls"]
        values = {
            "mode": "client",
            "connect/endpoints": [f"tls/127.0.0.1:{port or self.port}"],
            "scouting/multicast/enabled": False,
            "scouting/gossip/enabled": False,
            "transport/shared_memory/enabled": False,
            "transport/link/tls": tls,
        }
        for key, value in values.items():
            config.insert_json5(key, json.dumps(value))
        return zenoh.open(config)

    def file(self, name: str) -> Path:
        """Return somebody's file; that of a router is in a folder of its own."""
        router = self.folder / name / "router.json5"
        return router if router.exists() else self.folder / f"{name}.json5"

    def content(self, name: str) -> dict[str, Any]:
        _, _, text = self.file(name).read_text().partition("\n")
        return json.loads(text)

    def rewrite(self, name: str, content: dict[str, Any]) -> None:
        self.file(name).write_text(f"// rewritten\n{json.dumps(content)}")

    def init(self, **options: Any) -> Secured:
        quietly(commands.init, InitOptions(folder=str(self.folder), port=self.port, **options))
        return self

    def add(self, **options: Any) -> str:
        return quietly(commands.add, AddOptions(dir=str(self.folder), **options))

    def renew(self, *names: str, **options: Any) -> str:
        return quietly(commands.renew, RenewOptions(dir=str(self.folder), name=names, **options))

    def revoke(self, *names: str) -> str:
        return quietly(commands.revoke, RevokeOptions(dir=str(self.folder), name=names))


def quietly(command: Any, options: Any, namespace: str = "vision") -> str:
    """Run a command in this process, and return what it printed."""
    printed = io.StringIO()
    with redirect_stdout(printed):
        command(options, Connection(namespace=namespace), Output())
    return printed.getvalue()


def secured(folder: Path, **options: Any) -> Secured:
    return Secured(folder / "security", free_port()).init(**options)


@contextmanager
def embedded(
    system: Secured, folder: Path, name: str = "router", **variables: str
) -> Iterator[Program]:
    """Run ``zv router`` with the credentials of a router."""
    words = ["router", "--credentials", system.file(name)]
    with Program(words, folder, name, forked=ZV, **variables) as router:
        wait_until(lambda: port_answers(port_of(system, name)), explain=lambda: router.complaints)
        yield router


def official(system: Secured, folder: Path, name: str = "router") -> AbstractContextManager[None]:
    """Run zenohd with the configuration of a router."""
    return zenohd(folder, port_of(system, name), "-c", system.file(name), name=name)


def port_of(system: Secured, name: str) -> int:
    (endpoint,) = system.content(name)["listen"]["endpoints"]
    return int(endpoint.partition("#")[0].rpartition(":")[2])


def move(system: Secured, name: str, port: int, connect: str) -> None:
    """Give a second router of one machine another port, and the first one to connect to."""
    content = system.content(name)
    content["listen"]["endpoints"] = [f"tls/127.0.0.1:{port}"]
    content["connect"]["endpoints"] = [connect]
    system.rewrite(name, content)
