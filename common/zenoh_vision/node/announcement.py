"""Announces a node by its liveliness token, its description and its diagnostics."""

from __future__ import annotations

import logging
import os
import socket
import threading
import time
from contextlib import suppress

import zenoh

from zenoh_vision import keys
from zenoh_vision.config.roles import value_of
from zenoh_vision.host.health_file import HealthFile
from zenoh_vision.messages import Diagnostics, Level, NodeDescription
from zenoh_vision.node.certificate_check import CertificateCheck
from zenoh_vision.node.core import Core
from zenoh_vision.node.namesake import NamesakeMonitor
from zenoh_vision.node.outputs import Outputs
from zenoh_vision.node.query_server import QueryServer
from zenoh_vision.topics import message_topic
from zenoh_vision.transport.publisher import Outgoing, StreamPublisher
from zenoh_vision.transport.zenoh_config import credentials_of
from zenoh_vision.version import installed_version

log = logging.getLogger(__name__)

PERIOD_S = 1.0
CLOSE_S = 1.0


class Announcement:
    """Declares a node's token, answers queries for its description, and sends its diagnostics.

    The diagnostics have a thread of their own, so that no query delays them.
    """

    def __init__(self, core: Core, outputs: Outputs) -> None:
        self._core = core
        self._outputs = outputs
        self._node = core.name
        self._health = core.health
        self._started_ns = core.clock.time_ns()
        self._health_file = HealthFile()
        self._namesake = NamesakeMonitor(core.name, core.health, self.description, core.clock)
        self._certificate: CertificateCheck | None = None
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._run, name="health", daemon=True)

    def description(self) -> NodeDescription:
        """Return the node's description at this moment."""
        core = self._core
        settings = None if core.revision is None else core.revision.settings
        return NodeDescription(
            node=core.name,
            service=core.service,
            cameras=tuple(core.cameras),
            version=installed_version(),
            host=socket.gethostname(),
            pid=os.getpid(),
            started_ns=self._started_ns,
            publishes=tuple(self._outputs.keys),
            subscribes=tuple(key for each in core.health.inputs for key in each.keys),
            stamp_ns=core.clock.time_ns(),
            rate_hz=core.health.rates.expected_hz,
            pipeline=value_of(settings, "pipeline", None),
        )

    def beat(self) -> None:
        """Update the health file while the node waits for a router.

        Waiting counts as healthy, but not being refused by one.
        """
        self._health_file.beat(self._health.failure())

    def note_refusal(self, why: str) -> None:
        """Report why the router refuses the connection; an empty text when it does no more."""
        self._health.report("connection", Level.ERROR if why else Level.OK, why)

    def declare(self, server: QueryServer) -> None:
        """Declare the diagnostics and the description; call ``start`` after everything else."""
        link, namespace = self._core.link, self._core.namespace
        self._key = keys.node_key(namespace, self._node)
        self._diagnostics = StreamPublisher(
            link,
            message_topic("diagnostics", Diagnostics),
            keys.diagnostics_key(namespace, self._node),
            server.queue,
        )
        server.declare(link, self._key, self._answer)
        self._namesake.declare(link, namespace)
        credentials = credentials_of(self._core.connection)
        if credentials is not None:
            self._certificate = CertificateCheck(link, credentials, self._health)

    def start(self) -> None:
        """Declare the token, so that observers see a complete node, and send diagnostics."""
        self._core.link.declare(lambda session: session.liveliness().declare_token(self._key))
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
        failure = self._outputs.shared_memory_failure
        self._health.report("shared_memory", Level.WARN if failure else Level.OK, failure)
        if self._certificate is not None:
            self._certificate.check(self._key)
        diagnostics = self._health.diagnostics()
        self._namesake.note_own(diagnostics)
        self._diagnostics.offer(lambda: Outgoing.message(diagnostics))
        with suppress(zenoh.ZError):  # the session is being replaced
            self._namesake.check()

    def _answer(self, query: zenoh.Query) -> None:
        outgoing = Outgoing.message(self.description())
        query.reply(self._key, outgoing.payload, encoding=outgoing.encoding)
