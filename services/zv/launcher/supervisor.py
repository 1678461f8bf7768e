"""Starts the processes of a system, restarts and shows them, and ends them in bounded time."""

from __future__ import annotations

import errno
import os
import signal
import sys
import threading
import time

from zenoh_vision.error_text import joined
from zenoh_vision.errors import ToldToStop
from zenoh_vision.health.fleet import SILENT_S, Fleet
from zenoh_vision.health.fleet_monitor import FleetMonitor
from zenoh_vision.health.node_state import NodeState
from zenoh_vision.host.health_file import HealthFile
from zenoh_vision.messages import Level, NodeDescription
from zenoh_vision.transport.connection import Connection
from zenoh_vision.transport.link import Link
from zv.launcher.child import WRONG_CONFIGURATION, Child
from zv.launcher.command_line import program_command_line, service_flags, zv_command_line
from zv.launcher.group_guard import GroupGuard
from zv.launcher.launch_file import Plan, PlannedNode, PlannedProgram
from zv.status.display import Display
from zv.status.process_usage import ProcessUsage
from zv.status.row import Row, number, row_of, view_of

POLL_S = 0.05
NODES_END_S = 1.2
"""When nodes that have not ended are killed."""

ALL_END_S = 1.4
"""When the router is: ``zv up`` ends within 2 s, also on a busy machine."""

SETTLED_S = 1.0
"""A router that cannot listen has ended within this time."""

ANNOUNCED_S = 10.0
"""A program that has announced no node after this time is shown as ``running, no node``."""

ASK_AGAIN_S = 2.0
MOST_KEYS = 6
"""Most keys of a program that are listed; a program for several cameras may have many."""

ROUTER = "router"


class System:
    """The processes of one launch file.

    Args:
        plan: The checked launch file.
        connection: Where the nodes find their router.
        listen: Where the embedded router listens; None uses a running one.
        greeting: Lines to show when the router is connected.
        display: Shows the nodes, and lines about events.
        debug: Whether the nodes log more.
    """

    def __init__(
        self,
        plan: Plan,
        connection: Connection,
        listen: str | None,
        greeting: list[str],
        display: Display,
        *,
        debug: bool = False,
    ) -> None:
        self.display = display
        self._connection = connection
        self._greeting = greeting
        self._monitor = FleetMonitor(Fleet())
        self._usage = ProcessUsage()
        self._stopping = False
        self._health_file = HealthFile()
        debug_flag = ["--debug"] if debug else []
        self._guard = GroupGuard()
        self._nodes = [
            self._program_child(node)
            if isinstance(node, PlannedProgram)
            else self._node_child(node, debug_flag)
            for node in plan.nodes
        ]
        self._programs = [node.name for node in plan.nodes if isinstance(node, PlannedProgram)]
        self._unnamed = set(self._programs)  # programs whose keys were not known for the greeting
        self._children = list(self._nodes)
        self._router: Child | None = None
        if listen is not None:
            flags = [ROUTER, "--listen", listen, *debug_flag]
            if plan.router_config:
                flags += ["--zenoh-config", plan.router_config]
            self._router = Child(ROUTER, zv_command_line(flags), say=display.say)
            self._children.insert(0, self._router)
        self._pids: dict[str, int] = {}

    def stop(self) -> None:
        """End everything; safe in a signal handler."""
        self._stopping = True

    def run(self) -> int:
        """Start everything, supervise it until told to stop, end everything.

        Returns:
            The exit status: 0, or that of a router whose configuration is wrong.
        """
        link = None
        try:
            # All at once: each waits for the router itself, and loading takes most of the time.
            for child in self._children:
                child.start()
            link = Link(
                self._connection,
                self._waiting_is_over,
                lambda: self._stopping,
                log_state=False,  # each node logs its own state of the link
            )
            names = [child.name for child in self._children]
            namespace = self._connection.namespace
            self._monitor.watch(link, namespace, "diagnostics", names=names)
            # A program in another language may announce a node that sends no diagnostics.
            self._monitor.watch(link, namespace, "token", names=self._programs)
            self._supervise(link)
        except ToldToStop:
            pass
        finally:
            self._end(link)
        return WRONG_CONFIGURATION if self._router_failed() else 0

    def _supervise(self, link: Link) -> None:
        for line in self._greeting:
            self.display.announce(line)
        while not self._is_over():
            for child in self._children:
                child.check()
                if child.pid is not None and self._pids.get(child.name) != child.pid:
                    self._pids[child.name] = child.pid
                    self._monitor.forget(child.name)
                    self._usage.begin(child.pid)
                if self._monitor.node(child.name) is not None:
                    child.mark_running()
                elif child.name in self._programs and child.age_s > ANNOUNCED_S:
                    self._mark_without_node(child)
            if self._unnamed:
                self._name_keys(link)
            router = self._router
            if router and router.age_s > SETTLED_S and link.connected:
                router.mark_running()
            known = [(child, self._monitor.node(child.name)) for child in self._children]
            failures = (failure_of(child, node) for child, node in known)
            self._health_file.beat("; ".join(filter(None, failures)))
            if self.display.due():
                rows = [
                    child_row(child, node, self._usage, descendants=child.name in self._programs)
                    for child, node in known
                ]
                self.display.show(view_of(rows))
            time.sleep(POLL_S)

    def _name_keys(self, link: Link) -> None:
        """Print the keys of each of the user's programs once its node has described itself."""
        self._monitor.ask_new(link, self._connection.namespace, ASK_AGAIN_S)
        for name in sorted(self._unnamed):
            node = self._monitor.node(name)
            if node is not None and node.description is not None:
                self._unnamed.discard(name)
                if line := published_line(node.description):
                    self.display.announce(line)

    def _mark_without_node(self, child: Child) -> None:
        if child.alive and child.state == "starting":
            self.display.say(
                f"{child.name} runs, but no node of this name has announced itself for "
                f"{ANNOUNCED_S:.0f} s: its row has neither rate nor health"
            )
            child.mark_running(announced=False)

    def _waiting_is_over(self) -> bool:
        """Tell whether to stop waiting for the router; waiting for it counts as healthy."""
        self._health_file.beat()
        return self._is_over()

    def _is_over(self) -> bool:
        """Tell whether to end, on request or because the router cannot start."""
        if self._router is not None:
            self._router.check()
        return self._stopping or self._router_failed()

    def _router_failed(self) -> bool:
        return self._router is not None and self._router.state == "failed"

    def _end(self, link: Link | None) -> None:
        """End the nodes, then the router, which the nodes need to undeclare their tokens."""
        began_s = time.monotonic()
        closing = threading.Thread(target=link.close if link else None, daemon=True)
        closing.start()  # closing may block if the router hangs
        for group, allowed_s in ((self._nodes, NODES_END_S), (self._children, ALL_END_S)):
            for child in group:
                child.terminate()
            for child in group:
                child.finish(began_s + allowed_s)
        self._guard.close()
        closing.join(max(0.0, began_s + ALL_END_S - time.monotonic()))

    def _node_child(self, node: PlannedNode, debug_flag: list[str]) -> Child:
        flags, secrets = service_flags(node.service, node.settings)
        flags += ["--connect", self._connection.connect]
        flags += ["--namespace", self._connection.namespace, *debug_flag]
        if self._connection.zenoh_config:
            flags += ["--zenoh-config", self._connection.zenoh_config]
        return Child(
            node.name,
            zv_command_line(flags, {**secrets, **node.variables}),
            restart=node.restart,
            finishes=node.service == "camera",
            say=self.display.say,
        )

    def _program_child(self, node: PlannedProgram) -> Child:
        return Child(
            node.name,
            program_command_line(
                node.name, node.words, node.variables, node.folder, self._connection
            ),
            restart=node.restart,
            finishes=True,
            say=self.display.say,
            guard=self._guard,
        )


def published_line(node: NodeDescription) -> str:
    """Return a line of text with the keys that a node publishes; empty if there are none."""
    keys = [key for key in node.publishes if not key.startswith("@")]
    return f"{node.node} publishes {joined(keys, MOST_KEYS)}" if keys else ""


def child_row(
    child: Child, node: NodeState | None, usage: ProcessUsage, *, descendants: bool = False
) -> Row:
    """Return the row of a child: the state of its process, and its node's health.

    With ``descendants``, CPU and memory are those of its process and all that it has started.
    """
    cpu, memory_mb = usage.read(child.pid, descendants=descendants)
    state = child.state
    if node is not None and node.report is not None and child.alive:
        silent_s = node.report_age_s(time.monotonic_ns())
        if silent_s <= SILENT_S:
            return row_of(child.name, node.report, state=state, cpu=cpu, memory_mb=memory_mb)
        state = f"silent for {silent_s:.0f} s"
    return Row(child.name, state, cpu=number(cpu), memory=number(memory_mb))


def failure_of(child: Child, node: NodeState | None) -> str:
    """Return why a child does not work; empty while it works, starts, or has finished."""
    if child.state in ("starting", "finished"):
        return ""
    if not child.alive:
        return f"{child.name} {child.state}"
    if node is None or node.report is None:
        return ""  # the router sends no diagnostics
    silent_s = node.report_age_s(time.monotonic_ns())
    if silent_s > SILENT_S:
        return f"{child.name} silent for {silent_s:.0f} s"
    return f"{child.name}: {node.report.message}" if node.report.level == Level.ERROR else ""


def run(system: System) -> int:
    """Run a system until SIGINT, SIGTERM or SIGHUP; return the exit status.

    Raises:
        RouterUnreachable: No router within the time allowed; everything was ended again.
    """
    for each in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(each, lambda _number, _at: system.stop())
    try:
        with system.display:
            return system.run()
    except OSError as error:
        # The reader of our output is gone (`zv up | head`, a closed terminal), and all processes
        # have ended. The rest of the buffer must not fail again at exit.
        if not isinstance(error, BrokenPipeError) and error.errno != errno.EIO:
            raise
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
