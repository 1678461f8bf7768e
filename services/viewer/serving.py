"""The web server: a loop on a thread of its own, before there is a router and while it is away."""

from __future__ import annotations

import asyncio
import contextlib
import logging
import resource
import socket
import threading
from types import TracebackType
from typing import Self

from aiohttp import web

from common.link import Link
from common.live import LiveSettings
from common.node import Node
from services.viewer.access import Access
from services.viewer.compatible import Compatible
from services.viewer.connections import Connections
from services.viewer.hub import Hub
from services.viewer.latest import Latest
from services.viewer.network import Network
from services.viewer.settings import ViewerSettings
from services.viewer.system import System
from services.viewer.watching import Watcher
from services.viewer.web import Application

log = logging.getLogger("viewer")

START_S = 10.0
END_S = 0.5
TICK_S = 0.5
KEEP_ALIVE_S = 15.0
MAX_LINE_BYTES = 4096
MAX_HEADERS = 64
FILES = 8192
"""Open files, connections among them, if the system lets us have so many."""


class WebServer:
    """Serves browsers while the ``with`` lasts.

    Args:
        listening: The socket; it is closed at the end.
        live: The settings.
        node: The node that this is the other side of; not open yet.
        access: Who may ask.
    """

    def __init__(
        self,
        listening: socket.socket,
        live: LiveSettings[ViewerSettings],
        node: Node,
        access: Access,
    ) -> None:
        self._listening = listening
        self._live = live
        self._node = node
        self._access = access
        self._ready = threading.Event()
        self._thread = threading.Thread(target=self._run, name="http", daemon=True)
        self._failed: BaseException | None = None

    def __enter__(self) -> Self:
        for name in ("aiohttp", "asyncio"):  # what clients do wrong is not for our log
            if not logging.getLogger().isEnabledFor(logging.DEBUG):
                logging.getLogger(name).setLevel(logging.CRITICAL)
        _more_files()
        self._thread.start()
        self._ready.wait(START_S)
        if self._failed is not None:
            raise self._failed
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        """Leave all clients, in bounded time."""
        self.stop()
        self._thread.join(2 * END_S)

    def begin(self, link: Link) -> None:
        """Go on to serve what comes over a link."""
        self._loop.call_soon_threadsafe(self._begin, link)

    def stop(self) -> None:
        """Begin to end; from any thread."""
        with contextlib.suppress(RuntimeError):
            self._loop.call_soon_threadsafe(self._stop.set)

    def _run(self) -> None:
        try:
            asyncio.run(self._serve())
        except BaseException as error:
            if self._ready.is_set():
                log.exception("the web server failed")
                self._node.stop()
            self._failed = error
            self._ready.set()

    async def _serve(self) -> None:
        self._loop = asyncio.get_running_loop()
        self._stop = asyncio.Event()
        self._network = Network(self._loop)
        self._hub = Hub(
            self._network,
            self._node.health,
            self._node.ledger,
            lambda: self._live.newest.settings,
        )
        system = System(
            self._node.connection.namespace,
            lambda text, replaces: application.tell_all(text, replaces),
        )
        self._watcher = Watcher(system, self._network)
        compatible = Compatible(self._hub, system, Latest(self._hub))
        application = Application(
            self._access,
            self._hub,
            self._watcher,
            compatible,
            lambda: self._live.newest.settings.max_clients,
        )
        self._node.listens = self._hub.listened
        runner = web.AppRunner(
            application.app,
            access_log=None,
            handler_cancellation=True,  # who leaves is not waited for until the next picture
            keepalive_timeout=KEEP_ALIVE_S,
            max_line_size=MAX_LINE_BYTES,
            max_headers=MAX_HEADERS,
            lingering_time=1.0,
            shutdown_timeout=END_S,
        )
        await runner.setup()
        assert runner.server is not None
        connections = Connections(runner.server)
        server = await self._loop.create_server(connections, sock=self._listening)
        tasks = [
            asyncio.create_task(self._watcher.run()),
            asyncio.create_task(self._turn()),
        ]
        self._ready.set()
        try:
            await self._stop.wait()
        finally:
            server.close()
            for task in tasks:
                task.cancel()
            connections.abort()
            self._hub.close()
            self._network.close()
            await asyncio.wait_for(runner.cleanup(), END_S)

    async def _turn(self) -> None:
        """Show that the loop comes round."""
        while True:
            self._node.health.turn()
            await asyncio.sleep(TICK_S)

    def _begin(self, link: Link) -> None:
        self._network.link = link
        self._watcher.begin()
        self._hub.begin()


def _more_files() -> None:
    """Allow this process as many connections as the system lets it have."""
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    wanted = FILES if hard == resource.RLIM_INFINITY else min(FILES, hard)
    if soft != resource.RLIM_INFINITY and soft < wanted:
        with contextlib.suppress(OSError, ValueError):  # a sandbox may forbid it
            resource.setrlimit(resource.RLIMIT_NOFILE, (wanted, hard))
