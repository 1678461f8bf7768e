"""The viewer's web server in this process, with a node that has no network."""

from __future__ import annotations

import threading
from types import SimpleNamespace
from typing import Any

from zenoh_vision.config.revisions import ParameterStore
from zenoh_vision.health.health import Health
from zenoh_vision.stream.counters import FrameCounters
from zv.viewer.http.access import Access
from zv.viewer.http.listener import listen
from zv.viewer.http.server import WebServer
from zv.viewer.settings import ViewerSettings


class FakeNode:
    """What the server uses of a node; ``stopped`` is set when it is told to stop."""

    def __init__(self) -> None:
        self.counters = FrameCounters()
        self.health = Health("viewer", self.counters)
        self.connection = SimpleNamespace(namespace="vision")
        self.stopped = threading.Event()
        self.stop = self.stopped.set


def serving(node: Any) -> WebServer:
    """Return a server on a free port of loopback, which needs no token."""
    access = Access(None, frozenset({"127.0.0.1"}))
    return WebServer(listen("127.0.0.1", 0), ParameterStore(ViewerSettings()), node, access)
