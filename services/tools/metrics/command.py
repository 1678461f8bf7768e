"""``zv metrics``: listens to the nodes on one side and to Prometheus on the other."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable
from functools import partial

import zenoh

from common.connection import Connection
from common.diagnostics import Complaints
from common.errors import PayloadError
from common.keys import diagnostics_key, node_key
from common.messages import Diagnostics, NodeDescription
from common.session import direct
from services.tools.metrics.board import Board
from services.tools.metrics.collector import NodeCollector
from services.tools.metrics.options import MetricsOptions
from services.tools.metrics.serving import MetricsServer
from services.tools.output import Output
from services.tools.session import ToolSession

log = logging.getLogger("metrics")

TICK_S = 1.0
STUCK_S = 5.0
ASK_AGAIN_S = 10.0
"""A node that does not say who it is, perhaps because it is none of ours, is asked again."""


def run(options: MetricsOptions, connection: Connection, output: Output) -> None:
    """Serve the metrics until told to stop, whether or not there is a router.

    Raises:
        ConfigurationError: The address cannot be listened on.
        RouterUnreachable: No router within the connection's time, if it has one.
    """
    exporter = Exporter(options.gone)
    with MetricsServer(options.listen, exporter.collector, exporter.trouble) as server:
        if output.as_json:
            output.record({"url": server.url})
        else:
            output.line(server.url)
        with ToolSession(connection) as session:
            exporter.listen(session)
            try:
                while session.wait(TICK_S):
                    exporter.tick(session)
            finally:
                exporter.leave()


class Exporter:
    """The nodes of a namespace, as they come, go and report.

    Args:
        gone_s: How long a node that is gone is listed as down.
    """

    def __init__(self, gone_s: float) -> None:
        self.board = Board(gone_s)
        self.collector = NodeCollector(self.board, self._connected)
        self._session: ToolSession | None = None
        self._complaints = Complaints(log)
        self._had_router = True
        self._turned_s: float | None = None
        self._asked_s: dict[str, float] = {}

    def listen(self, session: ToolSession) -> None:
        """Listen to the tokens and the health of all nodes."""
        namespace = session.namespace
        on_token = direct(partial(self._guarded, self._on_token))
        session.link.declare(
            lambda opened: opened.liveliness().declare_subscriber(
                node_key(namespace, "*"), on_token, history=True
            )
        )
        session.subscribe(diagnostics_key(namespace, "*"), partial(self._guarded, self._on_report))
        self._session = session

    def trouble(self) -> str:
        """Return why what is served may be old; to wait for a router is no reason."""
        since_s = 0.0 if self._turned_s is None else time.monotonic() - self._turned_s
        return f"the loop has been stuck for {since_s:.0f} s" if since_s > STUCK_S else ""

    def leave(self) -> None:
        """Ask the session nothing any more: it is about to close."""
        self._session = None

    def tick(self, session: ToolSession) -> None:
        """Once a second: ask new nodes who they are, sum up what was rejected."""
        now_s = self._turned_s = time.monotonic()
        self._complaints.settle(now_s)
        connected = session.connected
        if connected != self._had_router:
            self._had_router = connected
            log.warning("the router is back" if connected else "the router is gone")
        unknown = self.board.undescribed()
        self._asked_s = {node: at for node, at in self._asked_s.items() if node in unknown}
        if any(now_s - self._asked_s.get(node, -ASK_AGAIN_S) >= ASK_AGAIN_S for node in unknown):
            self._asked_s = dict.fromkeys(unknown, now_s)
            for reply in session.ask(node_key(session.namespace, "*")):
                if reply.ok is not None:
                    self._guarded(self._on_description, reply.ok)

    def _connected(self) -> bool:
        session = self._session
        return session is not None and session.connected

    def _guarded(self, take: Callable[[str, zenoh.Sample], None], sample: zenoh.Sample) -> None:
        """Hand a sample on with its node's name; one of no use is counted and logged once."""
        try:
            take(str(sample.key_expr).rpartition("/")[2], sample)
        except PayloadError as error:
            self.board.reject(error)
            self._complaints.note(error, time.monotonic())

    def _on_token(self, node: str, sample: zenoh.Sample) -> None:
        if sample.kind == zenoh.SampleKind.PUT:
            self.board.came(node, time.monotonic())
        else:
            self.board.went(node, time.monotonic())

    def _on_report(self, node: str, sample: zenoh.Sample) -> None:
        if sample.kind != zenoh.SampleKind.PUT:
            raise PayloadError("bad_message", f"a delete instead of the health of {node!r}")
        health = Diagnostics.from_bytes(sample.payload.to_bytes())
        self.board.report(node, health, time.monotonic())

    def _on_description(self, node: str, sample: zenoh.Sample) -> None:
        description = NodeDescription.from_bytes(sample.payload.to_bytes())
        self.board.describe(node, description)
