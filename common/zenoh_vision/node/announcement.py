"""Announces a node by its liveliness token, its description and its diagnostics."""

from __future__ import annotations

import logging
import os
import socket
import threading
import time
from contextlib import suppress
from importlib import metadata
from typing import Any, Protocol

import zenoh

from zenoh_vision import keys
from zenoh_vision.config.revisions import ParameterStore
from zenoh_vision.health.health import Health
from zenoh_vision.host.health_file import HealthFile
from zenoh_vision.messages import Diagnostics, NodeDescription
from zenoh_vision.node.namesake import NamesakeMonitor
from zenoh_vision.node.outputs import Outputs
from zenoh_vision.node.query_server import QueryServer
from zenoh_vision.topics import message_topic
from zenoh_vision.transport.link import Link
from zenoh_vision.transport.publisher import Outgoing, StreamPublisher

log = logging.getLogger(__name__)

PERIOD_S = 1.0
CLOSE_S = 1.0


def installed_version() -> str:
    """Return the version of this distribution, ``unknown`` when run without installing it."""
    try:
        return metadata.version("zenoh-vision")
    except metadata.PackageNotFoundError:
        return "unknown"


class Owner(Protocol):
    """The part of a node that its announcement uses."""

    name: str
    service: str
    cameras: tuple[str, ...]
    outputs: Outputs
    health: Health
    parameters: ParameterStore[Any] | None


class Announcement:
    """Declares a node's token, answers queries for its description, and sends its diagnostics.

    The diagnostics have a thread of their own, so that no query delays them.
    """

    def __init__(self, node: Owner) -> None:
        self._owner = node
        self._node = node.name
        self._health = node.health
        self._started_ns = time.time_ns()
        self._health_file = HealthFile()
        self._namesake = NamesakeMonitor(node.name, node.health, self.description)
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._run, name="health", daemon=True)

    def description(self) -> NodeDescription:
        """Return the node's description at this moment."""
        node = self._owner
        settings = None if node.parameters is None else node.parameters.active.settings
        return NodeDescription(
            node=node.name,
            service=node.service,
            cameras=tuple(node.cameras),
            version=installed_version(),
            host=socket.gethostname(),
            pid=os.getpid(),
            started_ns=self._started_ns,
            publishes=tuple(node.outputs.keys),
            subscribes=tuple(key for each in node.health.inputs for key in each.keys),
            stamp_ns=time.time_ns(),
            rate_hz=node.health.rates.expected_hz,
            pipeline=getattr(settings, "pipeline", None),
        )

    def beat(self) -> None:
        """Update the health file while the node waits for a router, which counts as healthy."""
        self._health_file.beat()

    def declare(self, link: Link, namespace: str, server: QueryServer) -> None:
        """Declare the diagnostics and the description; call ``start`` after everything else."""
        self._link = link
        self._key = keys.node_key(namespace, self._node)
        self._diagnostics = StreamPublisher(
            link,
            message_topic("diagnostics", Diagnostics),
            keys.diagnostics_key(namespace, self._node),
            server.queue,
        )
        server.declare(link, self._key, self._answer)
        self._namesake.declare(link, namespace)

    def start(self) -> None:
        """Declare the token, so that observers see a complete node, and send diagnostics."""
        self._link.declare(lambda session: session.liveliness().declare_token(self._key))
        self._thread.start()

    def close(self) -> None:
        """Send the diagnostics a last time."""
        self._ended.set()
        self._thread.join(CLOSE_S)

    def _run(self) -> None:
        due_s = time.monotonic() + PERIOD_S
        ended = False
        while not ended:
            ended = self._ended.wait(max(0.0, due_s - time.monotonic()))
            due_s = max(due_s + PERIOD_S, time.monotonic())
            try:
                self._send()
            except Exception:
                log.exception("the diagnostics could not be sent")

    def _send(self) -> None:
        self._health_file.beat(self._health.failure())
        self._health.shared_memory = self._owner.outputs.shared_memory_failure
        diagnostics = self._health.diagnostics()
        self._namesake.note_own(diagnostics)
        self._diagnostics.offer(lambda: Outgoing.message(diagnostics))
        with suppress(zenoh.ZError):  # the session is being replaced
            self._namesake.check()

    def _answer(self, query: zenoh.Query) -> None:
        outgoing = Outgoing.message(self.description())
        query.reply(self._key, outgoing.payload, encoding=outgoing.encoding)
