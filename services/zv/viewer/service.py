"""Runs the viewer: a web server on one side, a node on the other."""

from __future__ import annotations

import contextlib
import time

from zenoh_vision.config.revisions import ParameterStore
from zenoh_vision.node.node import Node
from zenoh_vision.transport.connection import Connection
from zv.viewer.credentials import view_token
from zv.viewer.http.access import Access, own_names
from zv.viewer.http.listener import listen, url
from zv.viewer.http.server import WebServer
from zv.viewer.http.token_store import token_for
from zv.viewer.settings import ViewerSettings

POLL_S = 0.05


def run(settings: ViewerSettings, connection: Connection) -> None:
    """Serve browsers until told to stop, whether or not there is a router.

    Raises:
        ConfigurationError: The address cannot be used.
        RouterUnreachable: No router within the connection's time, if that is limited.
    """
    listening = listen(settings.host, settings.port)
    token = token_for(settings.host, settings.token, names=settings.names)
    access = Access(token, own_names(settings.host, settings.names))
    parameters = ParameterStore(settings)
    node = Node("viewer", camera=(), connection=connection, parameters=parameters)
    port = listening.getsockname()[1]
    lines = url(settings.host, port, token, settings.address)
    if token:
        view_only = url(settings.host, port, view_token(token), settings.address)
        lines += f"\nview only: {view_only}"
    with WebServer(listening, parameters, node, access) as server:
        with contextlib.suppress(OSError):  # perhaps nobody reads our output any more
            print(lines, flush=True)
        with node:
            server.connect(node.link)
            while not node.stopping:
                parameters.activate()
                time.sleep(POLL_S)
            server.stop()
