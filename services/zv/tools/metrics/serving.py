"""The HTTP server for Prometheus, on loopback by default."""

from __future__ import annotations

import errno
import logging
import socket
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from socketserver import TCPServer
from typing import Any
from wsgiref.simple_server import WSGIRequestHandler, make_server

from prometheus_client import CollectorRegistry, ProcessCollector, make_wsgi_app
from prometheus_client.exposition import ThreadingWSGIServer
from prometheus_client.registry import Collector

from zenoh_vision.errors import ConfigurationError
from zenoh_vision.host.health_file import HealthFile

log = logging.getLogger("metrics")

MAX_REQUESTS = 16
"""Limit of simultaneous requests. A scraper needs one; more are refused without a thread."""

POLL_S = 0.1
IDLE_S = 10.0
"""A client that is silent for this long is disconnected."""


class _Handler(WSGIRequestHandler):
    timeout = IDLE_S

    def log_message(self, format: str, *args: Any) -> None:  # noqa: A002 - the base's name
        log.debug(format, *args)


class _Server(ThreadingWSGIServer):
    failure: Callable[[], str]

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        self._free = threading.BoundedSemaphore(MAX_REQUESTS)
        self._health_file = HealthFile()
        super().__init__(*args, **kwargs)

    def service_actions(self) -> None:
        """Write the file for health checks; called at least every ``POLL_S``."""
        self._health_file.beat(self.failure())

    def server_bind(self) -> None:
        """Bind without the base class's DNS look-up of our own name, which may take long."""
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
        """Log an error for debugging only: usually the client has disconnected."""
        log.debug("a request from %s failed", client_address, exc_info=True)


@contextmanager
def serve(listen: str, collector: Collector, failure: Callable[[], str] = str) -> Iterator[str]:
    """Serve a collector's metrics over HTTP within the ``with`` block, and yield the URL.

    Requests in progress at the end of the block end with the process.

    Args:
        listen: ``HOST:PORT``; port 0 for a free one.
        collector: The metrics.
        failure: Returns why the metrics are out of date; empty while they are up to date.

    Raises:
        ConfigurationError: The address cannot be used; the text has the reason and a remedy.
    """
    registry = CollectorRegistry()
    registry.register(collector)
    ProcessCollector(registry=registry)
    server = _bound(listen, make_wsgi_app(registry))
    server.failure = failure
    threading.Thread(target=server.serve_forever, args=(POLL_S,), name="http", daemon=True).start()
    host = f"[{server.server_name}]" if ":" in server.server_name else server.server_name
    try:
        yield f"http://{host}:{server.server_port}/metrics"
    finally:
        server.shutdown()
        server.server_close()


def _bound(listen: str, application: Any) -> _Server:
    host, _, port = listen.rpartition(":")
    host = host.strip("[]")
    try:
        family = socket.getaddrinfo(host, int(port), type=socket.SOCK_STREAM)[0][0]
        server = type("Server", (_Server,), {"address_family": family})
        return make_server(host, int(port), application, server, _Handler)
    except (OSError, UnicodeError) as error:
        if getattr(error, "errno", None) == errno.EADDRINUSE:
            raise ConfigurationError(
                f"listen = {listen!r}: the port is in use, perhaps by another `zv metrics`; "
                "listen elsewhere with --listen HOST:PORT"
            ) from None
        why = getattr(error, "strerror", None) or error
        raise ConfigurationError(
            f"listen = {listen!r} is not possible: {why}; allowed: HOST:PORT of this machine"
        ) from None
