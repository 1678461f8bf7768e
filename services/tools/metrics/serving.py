"""HTTP for Prometheus: one small server, on loopback unless told otherwise."""

from __future__ import annotations

import errno
import logging
import socket
import threading
from collections.abc import Callable
from socketserver import TCPServer
from types import TracebackType
from typing import Any, Self
from wsgiref.simple_server import WSGIRequestHandler, make_server

from prometheus_client import CollectorRegistry, ProcessCollector, make_wsgi_app
from prometheus_client.exposition import ThreadingWSGIServer
from prometheus_client.registry import Collector

from common.errors import ConfigurationError
from common.heartbeat import Heartbeat

log = logging.getLogger("metrics")

MAX_REQUESTS = 16
"""At once. A scraper needs one; the rest is turned away before it costs a thread."""

POLL_S = 0.1
IDLE_S = 10.0
"""After so long a client that says nothing is left."""


class _Handler(WSGIRequestHandler):
    timeout = IDLE_S

    def log_message(self, format: str, *args: Any) -> None:  # noqa: A002 - the base's name
        log.debug(format, *args)


class _Server(ThreadingWSGIServer):
    def __init__(self, *args: Any, **kwargs: Any) -> None:
        self._free = threading.BoundedSemaphore(MAX_REQUESTS)
        self.heartbeat = Heartbeat()
        self.trouble: Callable[[], str] = str
        super().__init__(*args, **kwargs)

    def service_actions(self) -> None:
        """Between two requests, at least every ``POLL_S``: say for a health check how it does."""
        self.heartbeat.beat(self.trouble())

    def server_bind(self) -> None:
        """Bind without asking the DNS for our own name, as the base does: that may take long."""
        TCPServer.server_bind(self)
        host, port = self.server_address[:2]
        self.server_name, self.server_port = str(host), int(port)
        self.setup_environ()

    def process_request(self, request: Any, client_address: Any) -> None:
        if not self._free.acquire(blocking=False):
            self.shutdown_request(request)
            return
        super().process_request(request, client_address)

    def process_request_thread(self, request: Any, client_address: Any) -> None:
        try:
            super().process_request_thread(request, client_address)
        finally:
            self._free.release()

    def handle_error(self, request: Any, client_address: Any) -> None:  # noqa: ARG002 - the base's
        """Say in a line what a traceback would say in many: most often the client went away."""
        log.debug("a request from %s failed", client_address, exc_info=True)


class MetricsServer:
    """Serves a collector's metrics over HTTP while the ``with`` lasts.

    Args:
        listen: ``HOST:PORT``; port 0 for a free one.
        collector: What is served.
        trouble: Tells why what is served is not true; empty when it is.

    Attributes:
        url: Where it is served.

    Raises:
        ConfigurationError: The address cannot be listened on; says why and the way out.
    """

    def __init__(self, listen: str, collector: Collector, trouble: Callable[[], str] = str) -> None:
        registry = CollectorRegistry()
        registry.register(collector)
        ProcessCollector(registry=registry)
        self._server = _bound(listen, make_wsgi_app(registry))
        self._server.trouble = trouble
        host = self._server.server_name
        shown = f"[{host}]" if ":" in host else host
        self.url = f"http://{shown}:{self._server.server_port}/metrics"
        self._thread = threading.Thread(
            target=self._server.serve_forever,
            name="http",
            daemon=True,
            kwargs={"poll_interval": POLL_S},
        )

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        """Stop listening; requests in work end with the process."""
        self._server.shutdown()
        self._server.server_close()


def _bound(listen: str, application: Any) -> _Server:
    host, _, port = listen.rpartition(":")
    host = host.strip("[]")
    try:
        family = socket.getaddrinfo(host, int(port), type=socket.SOCK_STREAM)[0][0]
        server = type("Server", (_Server,), {"address_family": family})
        return make_server(host, int(port), application, server, _Handler)
    except OSError as error:
        raise ConfigurationError(_cannot_listen(listen, error)) from None


def _cannot_listen(listen: str, error: OSError) -> str:
    if error.errno == errno.EADDRINUSE:
        return (
            f"listen = {listen!r}: the port is taken, perhaps by another `zv metrics`; "
            "listen elsewhere with --listen HOST:PORT"
        )
    why = error.strerror or error
    return f"listen = {listen!r} is not possible: {why}; allowed: HOST:PORT of this machine"
