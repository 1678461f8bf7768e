"""The viewer's life: a web server on one side, a node on the other."""

from __future__ import annotations

import contextlib
import time
from urllib.parse import urlsplit

from common.connection import Connection
from common.live import LiveSettings
from common.node import Node
from services.viewer.access import Access, own_names, token_for
from services.viewer.listening import listen, url
from services.viewer.serving import WebServer
from services.viewer.settings import ViewerSettings

POLL_S = 0.05


def run(settings: ViewerSettings, connection: Connection) -> None:
    """Serve browsers until told to stop, whether or not there is a router.

    Raises:
        ConfigurationError: The address cannot be served on.
        RouterUnreachable: No router within the connection's time, if it has one.
    """
    listening = listen(settings.host, settings.port)
    token = token_for(settings.host, settings.token)
    names = ",".join(filter(None, (settings.allow_host, urlsplit(settings.address).hostname)))
    access = Access(token, own_names(settings.host, names))
    live = LiveSettings(settings)
    node = Node("viewer", camera=(), connection=connection, parameters=live)
    address = url(settings.host, listening.getsockname()[1], token, settings.address)
    with WebServer(listening, live, node, access) as server:
        with contextlib.suppress(OSError):  # who read our output may be gone
            print(address, flush=True)
        with node:
            server.begin(node.link)
            while not node.stopping:
                live.take()
                time.sleep(POLL_S)
            server.stop()
