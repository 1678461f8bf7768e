"""``zv up``: start everything, watch it, end it. What is started was checked before."""

from __future__ import annotations

import errno
import os
import signal
import sys
import threading
import time
from types import FrameType

from rich.console import Console

from common.connection import Connection
from common.errors import ToldToStop
from common.heartbeat import Heartbeat
from common.link import Link
from common.zenoh_config import client_config, router_config
from services.figures.board import HealthBoard
from services.figures.display import LINE_PERIOD_S, Display, LiveTable, PlainLines
from services.figures.meter import Meter
from services.figures.row import Row
from services.launch_file import Plan, PlannedNode
from services.up.command import command_of
from services.up.figures import row_of
from services.up.greeting import how_to_subscribe
from services.up.health import trouble_of
from services.up.processes import WRONG_CONFIGURATION, Child

POLL_S = 0.05
NODES_END_S = 1.3
ALL_END_S = 1.5
SETTLED_S = 1.0
"""A router that cannot listen has ended by then."""

ROUTER = "router"


class System:
    """The processes of one launch file.

    Args:
        plan: What the file asks for, found good.
        connection: Where the nodes find their router.
        listen: Where the embedded router listens; None uses the one that is there.
        display: Where figures and lines go.
        debug: Let the nodes log more.
    """

    def __init__(
        self,
        plan: Plan,
        connection: Connection,
        listen: str | None,
        display: Display,
        *,
        debug: bool = False,
    ) -> None:
        self._plan = plan
        self._connection = connection
        self._display = display
        self._meter = Meter()
        self._stopping = False
        self._debug = ["--debug"] if debug else []
        self._router = None if listen is None else self._router_child(listen)
        self._nodes = [self._node_child(node) for node in plan.nodes]
        self._lives: dict[str, int] = {}
        self._heartbeat = Heartbeat()

    def stop(self) -> None:
        """End everything; safe in a signal handler."""
        self._stopping = True

    def run(self) -> int:
        """Start everything, watch it until told to stop, end everything.

        Returns:
            The exit status: 0, or that of a router whose configuration is wrong.
        """
        link = None
        try:
            # All at once: they wait for the router themselves, and loading takes the longest.
            for child in self._children():
                child.start()
            link = self._open()
            if link is not None:
                self._watch(link, HealthBoard(link, self._connection.namespace))
        finally:
            self._end(link)
        return WRONG_CONFIGURATION if self._router_failed() else 0

    def _open(self) -> Link | None:
        """Wait for the router; None if it cannot start or we are told to stop."""
        try:
            return Link(self._connection, self._waiting_is_over, lambda: self._stopping)
        except ToldToStop:
            return None

    def _watch(self, link: Link, board: HealthBoard) -> None:
        for line in how_to_subscribe(self._plan, self._connection, own=self._router is not None):
            self._display.announce(line)
        while not self._to_end():
            for child in self._children():
                child.look_after()
                if child.pid is not None and self._lives.get(child.name) != child.pid:
                    self._lives[child.name] = child.pid
                    board.forget(child.name)
                    self._meter.begin(child.pid)
                if board.of(child.name) is not None:
                    child.heard()
            router = self._router
            settled = router is not None and router.age_s > SETTLED_S
            if router and settled and link.connected:
                router.heard()
            troubles = (trouble_of(child, board.of(child.name)) for child in self._children())
            self._heartbeat.beat("; ".join(filter(None, troubles)))
            self._display.show(lambda: self._rows(board))
            time.sleep(POLL_S)

    def _waiting_is_over(self) -> bool:
        """Tell whether to give up on the router; to wait for it is to be well."""
        self._heartbeat.beat()
        return self._to_end()

    def _to_end(self) -> bool:
        """Tell whether it is time to end: told to, or there will be no router."""
        if self._router is not None:
            self._router.look_after()
        return self._stopping or self._router_failed()

    def _router_failed(self) -> bool:
        return self._router is not None and self._router.state == "failed"

    def _rows(self, board: HealthBoard) -> list[Row]:
        return [row_of(child, board.of(child.name), self._meter) for child in self._children()]

    def _children(self) -> list[Child]:
        return [*([self._router] if self._router else []), *self._nodes]

    def _end(self, link: Link | None) -> None:
        """End the nodes, then the router that they say goodbye through."""
        began_s = time.monotonic()
        closing = threading.Thread(target=_close, args=(link,), daemon=True)
        closing.start()  # a router that hangs must not hold us up
        for group, allowed_s in ((self._nodes, NODES_END_S), (self._children(), ALL_END_S)):
            for child in group:
                child.terminate()
            for child in group:
                child.finish(began_s + allowed_s)
        closing.join(max(0.0, began_s + ALL_END_S - time.monotonic()))

    def _node_child(self, node: PlannedNode) -> Child:
        flags, secret = command_of(node)
        flags += ["--connect", self._connection.connect]
        flags += ["--namespace", self._connection.namespace, *self._debug]
        if self._connection.zenoh_config:
            flags += ["--zenoh-config", self._connection.zenoh_config]
        return Child(
            node.name,
            flags,
            restart=node.restart,
            finishes=node.service == "camera",
            say=self._display.say,
            environment=secret,
        )

    def _router_child(self, listen: str) -> Child:
        flags = [ROUTER, "--listen", listen, *self._debug]
        if self._plan.router_config:
            flags += ["--zenoh-config", self._plan.router_config]
        return Child(ROUTER, flags, say=self._display.say)


def _close(link: Link | None) -> None:
    if link is not None:
        link.close()


def run(
    plan: Plan, connection: Connection, listen: str | None, *, plain: bool, debug: bool = False
) -> int:
    """Run a system until SIGINT, SIGTERM or SIGHUP; return the exit status.

    Raises:
        ConfigurationError: Of Zenoh's own configuration files; nothing was started then.
        RouterUnreachable: No router within the time allowed; all was ended again.
    """
    client_config(connection)
    if listen is not None:
        router_config(listen, plan.router_config)
    console = Console(highlight=False)
    # A terminal that cannot move its cursor gets lines too.
    on_terminal = console.is_terminal and not console.is_dumb_terminal and not plain
    display: Display = LiveTable(console) if on_terminal else PlainLines(LINE_PERIOD_S)
    system = System(plan, connection, listen, display, debug=debug)

    def on_signal(_number: int, _at: FrameType | None) -> None:
        system.stop()

    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, on_signal)
    try:
        with display:
            return system.run()
    except OSError as error:
        # The reader of our output is gone (`zv up | head`, a closed terminal): all has ended.
        # What is left in the buffer must not fail once more at exit.
        if not isinstance(error, BrokenPipeError) and error.errno != errno.EIO:
            raise
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
