"""Runs the viewer: a web server on one side, a node on the other."""

from __future__ import annotations

import contextlib
import socket
import time
from functools import partial
from pathlib import Path

from zenoh_vision.config.revisions import ParameterStore
from zenoh_vision.node.node import Node
from zenoh_vision.transport.connection import Connection
from zv.viewer.credentials import view_token
from zv.viewer.http.access import Access, own_names
from zv.viewer.http.listener import listen, url
from zv.viewer.http.server import WebServer
from zv.viewer.http.tls import ServerTls
from zv.viewer.http.token_store import token_of
from zv.viewer.kept.handlers import KeptEvents
from zv.viewer.kept.keeper import EventKeeper, file_in
from zv.viewer.kept.store import EventStore
from zv.viewer.recorded import playing
from zv.viewer.settings import ViewerSettings

POLL_S = 0.05


def run(settings: ViewerSettings, connection: Connection) -> None:
    """Serve browsers until told to stop, whether or not there is a router.

    Raises:
        ConfigurationError: The address cannot be used.
        SourceError: The recording cannot be played.
        RouterUnreachable: No router within the connection's time, if that is limited.
    """
    listening = listen(settings.host, settings.port)
    with contextlib.ExitStack() as opening:
        if settings.recording is not None:
            connection = opening.enter_context(
                playing(settings.recording, connection, settings.start)
            )
        serve(settings, connection, listening)


def serve(settings: ViewerSettings, connection: Connection, listening: socket.socket) -> None:
    """Serve browsers on a socket until told to stop."""
    tls = None if settings.tls_certificate is None else ServerTls(settings)
    token = token_of(settings)
    names = own_names(settings.host, settings.names)
    access = Access(token, names, settings.base_path, None if tls is None else tls.holders)
    parameters = ParameterStore(settings)
    node = Node(
        "viewer",
        name=settings.node_name,
        camera=(),
        connection=connection,
        parameters=parameters,
    )
    port = listening.getsockname()[1]
    shown = partial(url, settings.host, port, address=settings.address, encrypted=tls is not None)
    lines = shown(token)
    if token:
        lines += f"\nview only: {shown(view_token(token))}"
    store = kept = None
    if settings.events_dir is not None and settings.keeps_events:
        file = file_in(settings.events_dir, connection.namespace, settings.node_name)
        store = EventStore(file)
        folder = settings.recordings_dir
        kept = KeptEvents(store, None if folder is None else Path(folder))
    with WebServer(listening, parameters, node, access, tls, kept) as server:
        with contextlib.suppress(OSError):  # perhaps nobody reads our output any more
            print(lines, flush=True)
        with node, contextlib.ExitStack() as keeping:
            server.connect(node.link)
            if store is not None:
                keeping.enter_context(EventKeeper(node, store, lambda: parameters.newest.settings))
            while not node.stopping:
                parameters.activate()
                time.sleep(POLL_S)
            server.stop()
