"""The web server: an event loop on its own thread, independent of whether there is a router."""

from __future__ import annotations

import asyncio
import contextlib
import logging
import resource
import socket
import threading
import time
from concurrent.futures import Future, ThreadPoolExecutor
from typing import Any, Self

from aiohttp import web

from zenoh_vision.config.revisions import ParameterStore
from zenoh_vision.messages import Level
from zenoh_vision.node.node import Node
from zenoh_vision.transport.link import Link
from zv.viewer.discovery.monitor import SystemMonitor
from zv.viewer.discovery.network import Network
from zv.viewer.discovery.system_state import SystemState
from zv.viewer.http.access import Access
from zv.viewer.http.app import Application
from zv.viewer.http.connections import FIRST_REQUEST_S, Connection
from zv.viewer.http.tls import ServerTls
from zv.viewer.kept.handlers import KeptEvents
from zv.viewer.settings import ViewerSettings
from zv.viewer.streams.registry import StreamRegistry
from zv.viewer.streams.shared_stream import RENDER_THREADS, StreamContext

log = logging.getLogger("viewer")

START_S = 10.0
STOP_S = 0.5
ALIVE_S = 0.5
TLS = "tls"
"""The condition of its health that tells of the certificate for browsers."""

FAULTY_S = 60.0
"""The node is in error for this long after an unexpected error on the event loop."""

MAX_OPEN_FILES = 8192
"""Limit of open files, including connections, if the system allows as many."""


class WebServer:
    """Serves browsers within the ``with`` block, at whose end the socket is closed."""

    def __init__(
        self,
        listening: socket.socket,
        parameters: ParameterStore[ViewerSettings],
        node: Node,
        access: Access,
        tls: ServerTls | None = None,
        kept: KeptEvents | None = None,
    ) -> None:
        self._listening = listening
        self._parameters = parameters
        self._node = node
        self._access = access
        self._tls = tls
        self._kept = kept
        self._started = Future[None]()
        self._failure: BaseException | None = None
        self._faulty_until_s = 0.0
        self._thread = threading.Thread(target=self._run, name="http", daemon=True)

    def __enter__(self) -> Self:
        if not logging.getLogger().isEnabledFor(logging.DEBUG):
            for name in ("aiohttp", "asyncio"):  # errors of clients do not belong in our log
                logging.getLogger(name).setLevel(logging.CRITICAL)
        _raise_file_limit()
        self._thread.start()
        self._started.result(START_S)
        return self

    def __exit__(self, *_: object) -> None:
        """Disconnect all clients, in bounded time; raise the error that has ended the server."""
        self.stop()
        self._thread.join(2 * STOP_S)
        if self._failure is not None:
            raise self._failure

    def connect(self, link: Link) -> None:
        """Begin to serve the streams of a link; from any thread."""
        self._loop.call_soon_threadsafe(self._connect, link)

    def stop(self) -> None:
        """Begin to stop; from any thread."""
        with contextlib.suppress(RuntimeError):
            self._loop.call_soon_threadsafe(self._stop.set)

    def _run(self) -> None:
        try:
            asyncio.run(self._serve())
        except BaseException as error:
            if not self._started.done():
                self._started.set_exception(error)
                return
            self._failure = error
            self._node.stop()

    async def _serve(self) -> None:
        self._loop = asyncio.get_running_loop()
        self._loop.set_exception_handler(self._report_error)
        self._stop = asyncio.Event()
        self._network = Network(self._loop)
        context = StreamContext(
            self._network,
            ThreadPoolExecutor(RENDER_THREADS, thread_name_prefix="render"),
            self._node.health,
            self._node.counters,
            lambda: self._parameters.newest.settings,
        )
        self._registry = StreamRegistry(context)
        system = SystemState(
            self._node.connection.namespace,
            lambda text, replaces: application.send_all(text, replaces),
            lambda kind: application.wanted(kind),
        )
        self._monitor = SystemMonitor(system, self._network)
        application = Application(self._access, self._registry, self._monitor, self._kept)
        runner = web.AppRunner(
            application.app,
            access_log=None,
            handler_cancellation=True,  # detects that a client is gone before the next picture
            keepalive_timeout=15.0,
            max_line_size=4096,
            max_headers=64,
            lingering_time=1.0,
            shutdown_timeout=STOP_S,
        )
        await runner.setup()
        handlers = runner.server
        assert handlers is not None
        idle: dict[Connection, None] = {}
        server = await self._loop.create_server(
            lambda: Connection(handlers(), idle), sock=self._listening, **self._encryption()
        )
        work = self._stop.wait(), self._monitor.run(), self._report_alive()
        tasks = [asyncio.ensure_future(each) for each in work]
        self._started.set_result(None)
        try:
            ended, _ = await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
            for task in ended:
                task.result()
        finally:
            server.close()
            for task in tasks:
                task.cancel()
            for handler in handlers.connections:
                if handler.transport is not None:
                    handler.transport.abort()
            context.pool.shutdown(wait=False, cancel_futures=True)
            self._network.close()
            with contextlib.suppress(TimeoutError):
                await asyncio.wait_for(runner.cleanup(), STOP_S)

    def _encryption(self) -> dict[str, Any]:
        """Return what ``create_server`` needs for TLS; a handshake is part of the first request."""
        if self._tls is None:
            return {}
        times = {"ssl_handshake_timeout": FIRST_REQUEST_S, "ssl_shutdown_timeout": STOP_S}
        return {"ssl": self._tls.context, **times}

    def _check_certificate(self, tls: ServerTls) -> None:
        tls.follow()
        said, health = tls.warning(), self._node.health
        if said != health.message(TLS):
            health.report(TLS, Level.WARN if said else Level.OK, said)
            log.warning("%s", said or "the certificate is right again")

    async def _report_alive(self) -> None:
        health = self._node.health
        while True:
            health.loop_alive()
            if self._tls is not None:
                self._check_certificate(self._tls)
            if self._faulty_until_s and time.monotonic() > self._faulty_until_s:
                self._faulty_until_s = 0.0
                health.report("bug", Level.OK)
            await asyncio.sleep(ALIVE_S)

    def _report_error(self, _: asyncio.AbstractEventLoop, context: dict[str, Any]) -> None:
        """Log an error that no caller sees, once per burst; the node is in error for a while."""
        error = context.get("exception")
        if error is None or isinstance(error, OSError):
            return  # a client has broken its connection
        if not self._faulty_until_s:
            log.error("%s", context["message"], exc_info=error)
            words = f"unexpected {type(error).__name__}: this is a bug in zv"
            self._node.health.report("bug", Level.ERROR, words)
        self._faulty_until_s = time.monotonic() + FAULTY_S

    def _connect(self, link: Link) -> None:
        self._network.link = link
        self._monitor.begin()
        self._registry.open()


def _raise_file_limit() -> None:
    """Allow this process as many connections as the system permits, up to a limit."""
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    wanted = MAX_OPEN_FILES if hard == resource.RLIM_INFINITY else min(MAX_OPEN_FILES, hard)
    if soft != resource.RLIM_INFINITY and soft < wanted:
        with contextlib.suppress(OSError, ValueError):  # a sandbox may forbid it
            resource.setrlimit(resource.RLIMIT_NOFILE, (wanted, hard))
