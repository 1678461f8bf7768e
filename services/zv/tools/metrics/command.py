"""``zv metrics``: follows the nodes of a namespace and serves their health to Prometheus."""

from __future__ import annotations

import logging
import time

from zenoh_vision import keys
from zenoh_vision.errors import PayloadError
from zenoh_vision.health.fleet import Fleet
from zenoh_vision.health.fleet_monitor import FleetMonitor
from zenoh_vision.health.log_throttle import LogThrottle
from zenoh_vision.transport.connection import Connection
from zv.tools.metrics.collector import NodeCollector
from zv.tools.metrics.options import MetricsOptions
from zv.tools.metrics.serving import serve
from zv.tools.shared.output import Output
from zv.tools.shared.session import ToolSession

log = logging.getLogger("metrics")

TICK_S = 1.0
STUCK_S = 5.0
ASK_AGAIN_S = 10.0
"""A node without a description, perhaps of another program, is asked again after this time."""


def run(options: MetricsOptions, connection: Connection, output: Output) -> None:
    """Serve the metrics until told to stop, whether or not there is a router.

    Raises:
        ConfigurationError: The address cannot be used.
        RouterUnreachable: No router within the connection's time, if it has one.
        ExpectationNotMet: The credentials do not allow to follow the nodes.
    """
    exporter = Exporter(options.gone)
    with serve(options.listen, exporter.collector, exporter.failure) as url:
        output.result({"url": url}, url)
        with ToolSession(connection) as session:
            exporter.run(session)


class Exporter:
    """Follows the nodes while there is a session; lists those gone for up to ``gone_s`` as down."""

    def __init__(self, gone_s: float) -> None:
        self._log_throttle = LogThrottle(log)
        self._monitor = FleetMonitor(Fleet(forget_s=gone_s), self._complain)
        self.collector = NodeCollector(self._monitor, self._connected)
        self._session: ToolSession | None = None
        self._ticked_s: float | None = None

    def failure(self) -> str:
        """Return why the metrics may be out of date; waiting for a router is not a failure."""
        since_s = 0.0 if self._ticked_s is None else time.monotonic() - self._ticked_s
        return f"the loop has been stuck for {since_s:.0f} s" if since_s > STUCK_S else ""

    def run(self, session: ToolSession) -> None:
        """Follow tokens and diagnostics, and query new nodes' descriptions, until stopped."""
        session.require("watch", keys.node_key(session.namespace, "*"))
        session.require("subscribe", keys.diagnostics_key(session.namespace, "*"))
        self._monitor.watch(session.link, session.namespace, "token", "diagnostics")
        self._session = session
        connected = True
        try:
            while session.wait(TICK_S):
                self._ticked_s = time.monotonic()
                self._log_throttle.flush(self._ticked_s)
                if session.connected != connected:
                    connected = not connected
                    log.warning("the router is back" if connected else "the router is gone")
                self._monitor.ask_new(session.link, session.namespace, ASK_AGAIN_S)
        finally:
            self._session = None  # it is about to be closed

    def _connected(self) -> bool:
        session = self._session
        return session is not None and session.connected

    def _complain(self, error: PayloadError) -> None:
        self._log_throttle.note(error, time.monotonic())
