"""``zv up``: check everything, start everything, watch it, end it."""

from __future__ import annotations

import signal
import sys
import time
from types import FrameType

import zenoh

from common.errors import ToldToStop
from common.session import Connection, open_session
from services.up.display import Display, LiveTable, PlainLines
from services.up.figures import Meter, Row, row_of
from services.up.health import HealthBoard
from services.up.launch_file import Plan, PlannedNode, flags_of
from services.up.processes import WRONG_CONFIGURATION, Child

POLL_S = 0.05
END_S = 1.5
ROUTER = "router"


class System:
    """The processes of one launch file.

    Args:
        plan: What the file asks for, found good.
        connection: Where the nodes find their router.
        display: Where figures and lines go.
        debug: Let the nodes log more.
    """

    def __init__(
        self, plan: Plan, connection: Connection, display: Display, *, debug: bool = False
    ) -> None:
        self._plan = plan
        self._connection = connection
        self._display = display
        self._meter = Meter()
        self._stopping = False
        self._debug = ["--debug"] if debug else []
        self._router = None if plan.router.connect else self._router_child()
        self._nodes = [self._child(node) for node in plan.nodes]
        self._lives: dict[str, int | None] = {}

    def stop(self) -> None:
        """End everything; safe in a signal handler."""
        self._stopping = True

    def run(self) -> int:
        """Start everything, watch it until told to stop, end everything.

        Returns:
            The exit status: 0, or that of a router whose configuration is wrong.
        """
        try:
            if self._router is not None:
                self._router.start()
            for node in self._nodes:
                node.start()
            session = self._open()
            if session is None:
                return 0 if self._stopping else WRONG_CONFIGURATION
            try:
                self._watch(HealthBoard(session, self._connection.namespace))
            finally:
                session.close()  # type: ignore[no-untyped-call]
        finally:
            self._end()
        return 0

    def _open(self) -> zenoh.Session | None:
        """Wait for the router; None if it cannot start or we are told to stop."""
        try:
            return open_session(self._connection, lambda: self._stopping or self._router_failed())
        except ToldToStop:
            return None

    def _router_failed(self) -> bool:
        if self._router is None:
            return False
        self._router.look_after()
        return self._router.state == "failed"

    def _watch(self, board: HealthBoard) -> None:
        for line in self._how_to_subscribe():
            self._display.say(line)
        while not self._stopping:
            for child in self._children():
                child.look_after()
                if self._lives.get(child.name) != child.pid:
                    self._lives[child.name] = child.pid
                    board.forget(child.name)
            self._display.show(lambda: self._rows(board))
            time.sleep(POLL_S)

    def _rows(self, board: HealthBoard) -> list[Row]:
        return [row_of(child, board.of(child.name), self._meter) for child in self._children()]

    def _children(self) -> list[Child]:
        return [*([self._router] if self._router else []), *self._nodes]

    def _end(self) -> None:
        """End the nodes, then the router that they say goodbye through."""
        deadline_s = time.monotonic() + END_S
        for group in (self._nodes, [self._router] if self._router else []):
            for child in group:
                child.terminate()
            for child in group:
                child.finish(deadline_s)

    def _child(self, node: PlannedNode) -> Child:
        arguments = [
            node.service,
            *flags_of(node.settings),
            "--connect",
            self._connection.connect,
            "--namespace",
            self._connection.namespace,
            *self._debug,
        ]
        if self._connection.zenoh_config:
            arguments += ["--zenoh-config", self._connection.zenoh_config]
        return Child(node.name, arguments, restart=node.restart, say=self._display.say)

    def _router_child(self) -> Child:
        arguments = [ROUTER, "--listen", self._plan.router.listen, *self._debug]
        if self._plan.router.zenoh_config:
            arguments += ["--zenoh-config", self._plan.router.zenoh_config]
        return Child(ROUTER, arguments, restart=True, say=self._display.say)

    def _how_to_subscribe(self) -> list[str]:
        cameras = sorted({node.name.split("_", 1)[1] for node in self._plan.nodes})
        where = f"{self._connection.namespace}/{cameras[0]}"
        return [
            f"router at {self._connection.connect}; cameras: {', '.join(cameras)}",
            f"subscribe to {where}/image/compressed (JPEG), {where}/centroid (msgpack), "
            f"{where}/edges/compressed (PNG), or to {where}/** for all",
            f"for example: python examples/subscribe.py {self._connection.connect}",
        ]


def run(plan: Plan, connection: Connection, *, plain: bool, debug: bool = False) -> int:
    """Run a system until SIGINT or SIGTERM; return the exit status."""
    on_terminal = sys.stdout.isatty() and not plain
    display: Display = LiveTable("zenoh-vision, Ctrl-C ends it") if on_terminal else PlainLines()
    system = System(plan, connection, display, debug=debug)

    def on_signal(_number: int, _at: FrameType | None) -> None:
        system.stop()

    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, on_signal)
    with display:
        return system.run()
