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
from zenoh_vision.host.group_guard import GroupGuard
from zenoh_vision.host.health_file import HealthFile
from zenoh_vision.keys import launch_key
from zenoh_vision.messages import Level, NodeDescription
from zenoh_vision.node.query_server import QueryServer
from zenoh_vision.transport.access import declare_holder
from zenoh_vision.transport.connection import Connection
from zenoh_vision.transport.link import Link
from zenoh_vision.transport.zenoh_config import credentials_of
from zv.launcher.child import Child
from zv.launcher.command_line import (
    CREDENTIALS,
    program_command_line,
    service_flags,
    zv_command_line,
)
from zv.launcher.launch_file import Plan, Planned, PlannedProgram
from zv.launcher.node_control import NodeControl
from zv.launcher.output_thread import written_on_threads
from zv.launcher.secure import SecureFiles
from zv.status.display import Display
from zv.status.process_usage import ProcessUsage
from zv.status.row import Row, number, row_of, view_of

POLL_S = 0.05
ROUTER_END_S = 0.3
"""When the router is killed after the nodes have ended; it has nothing to finish."""

SETTLED_S = 1.0
"""A router that cannot listen has ended within this time."""

ANNOUNCED_S = 10.0
"""A program that has announced no node after this time is shown as ``running, no node``."""

ASK_AGAIN_S = 2.0
TOLERANCE_S = 0.5
"""The end of a process is seen later than it comes."""

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
        secure: The certificates of router and nodes, if they have some.
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
        secure: SecureFiles | None = None,
        debug: bool = False,
    ) -> None:
        self._secure = secure
        self.display = display
        self._connection = connection
        self._greeting = greeting
        self._monitor = FleetMonitor(Fleet())
        self._usage = ProcessUsage()
        self._stopping = False
        self._health_file = HealthFile()
        debug_flag = ["--debug"] if debug else []
        self._guard = GroupGuard(plan.grace_s)
        self._grace_s = plan.grace_s
        self._nodes = [self._child(node, debug_flag) for node in plan.nodes]
        self._programs = [node.name for node in plan.nodes if isinstance(node, PlannedProgram)]
        self._unnamed = set(self._programs)  # programs whose keys were not known for the greeting
        self._children = list(self._nodes)
        self._router: Child | None = None
        if listen is not None:
            flags = [ROUTER, "--listen", listen, *debug_flag]
            if secure is not None:
                flags += ["--credentials", str(secure.router)]
            elif plan.router_config:
                flags += ["--zenoh-config", plan.router_config]
            line = zv_command_line(flags)
            # Without the router nothing works: its failure ends all.
            self._router = Child(ROUTER, line, required=True, say=display.say)
            self._children.insert(0, self._router)
        self._pids: dict[str, int] = {}
        self._control = NodeControl(
            connection.namespace, {child.name: child for child in self._nodes}, plan.grace_s
        )
        self._queries = QueryServer()

    def stop(self, number: int) -> None:
        """End everything on a signal; at once on Ctrl-C while it ends. Safe in a signal handler."""
        if self._stopping and number == signal.SIGINT:
            for child in self._children:
                child.terminate(signal.SIGKILL)
        self._stopping = True

    def run(self) -> int:
        """Start everything, supervise it until it is over, end everything.

        It is over when told to stop, when all nodes have ended or a required one has, and when the
        router cannot start.

        Returns:
            The exit status: 0 when told to stop and if the nodes ended with 0; else that of the
            required node, of the first node that did not end with 0, or of the router.
        """
        status = 0
        link = None
        if self._router is None:  # a variable of the environment is easily forgotten
            self.display.say(
                f"no router is started: the nodes use that at {self._connection.connect}, which "
                "--connect, ZV_CONNECT or the launch file names"
            )
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
            if (credentials := credentials_of(self._connection)) is not None:
                declare_holder(link, credentials)
            names = [child.name for child in self._children]
            namespace = self._connection.namespace
            self._monitor.watch(link, namespace, "diagnostics", names=names)
            # A program in another language may announce a node that sends no diagnostics.
            self._monitor.watch(link, namespace, "token", names=self._programs)
            self._queries.declare(link, launch_key(namespace, "*"), self._control.answer)
            self._queries.start()
            self._supervise(link)
        except ToldToStop:
            pass
        finally:
            if not self._stopping:
                status = self._status()
            self._end(link)
        return status

    def _supervise(self, link: Link) -> None:
        for line in self._greeting:
            self.display.announce(line)
        while not self._is_over():
            self._control.step()
            for child in self._children:
                if child.pid is not None and self._pids.get(child.name) != child.pid:
                    self._pids[child.name] = child.pid
                    self._monitor.forget(child.name)
                    self._usage.begin(child.pid)
                if child.alive and self._monitor.node(child.name) is not None:
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
        """Start again what has died, and tell whether it is over; see ``run``."""
        for child in self._children:
            child.check()
        return (
            self._stopping
            or any(child.ended and child.required for child in self._children)
            or all(child.ended for child in self._nodes)
        )

    def _status(self) -> int:
        """Say why it is over, and return the exit status, which for a signal is as in a shell.

        It is that of a required child, else of the first that did not end with 0.
        """
        ended = [child for child in self._children if child.ended]
        required = [child for child in ended if child.required]
        if required:
            self.display.say(f"{required[0].name} is required, so everything ends")
        elif ended:
            self.display.say("all nodes have ended")
        statuses = [child.exit_status or 0 for child in required[:1] or ended]
        status = next(filter(None, statuses), 0)
        return status if status >= 0 else 128 - status

    def _end(self, link: Link | None) -> None:
        """End the nodes, then the router, which the nodes need to undeclare their tokens."""
        self._queries.close()
        closing = threading.Thread(target=link.close if link else None, daemon=True)
        closing.start()  # closing may block if the router hangs
        for group, allowed_s in ((self._nodes, self._grace_s), (self._children, ROUTER_END_S)):
            for child in group:
                child.terminate()
            deadline_s = time.monotonic() + allowed_s
            for child in group:
                child.finish(deadline_s)
        self._guard.close()
        closing.join(max(0.0, deadline_s - time.monotonic()))

    def _child(self, node: Planned, debug_flag: list[str]) -> Child:
        own = {} if self._secure is None else {CREDENTIALS: str(self._secure.nodes[node.name])}
        if isinstance(node, PlannedProgram):
            variables = {**own, **node.variables}
            line = program_command_line(
                node.name, node.words, variables, node.folder, self._connection
            )
        else:
            flags, secrets = service_flags(node.service, node.settings)
            flags += ["--connect", self._connection.connect]
            flags += ["--namespace", self._connection.namespace, *debug_flag]
            if self._connection.zenoh_config:
                flags += ["--zenoh-config", self._connection.zenoh_config]
            line = zv_command_line(flags, {**secrets, **own, **node.variables})
        return Child(
            node.name,
            line,
            restart=node.restart,
            finishes=isinstance(node, PlannedProgram) or node.service == "camera",
            required=node.required,
            say=self.display.say,
            guard=self._guard if isinstance(node, PlannedProgram) else None,
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
    is_of_others = node is not None and not child.alive and _began_after(child, node)
    if node is not None and node.report is not None and (child.alive or is_of_others):
        state = "running, by hand" if is_of_others else state
        silent_s = node.report_age_s(time.monotonic_ns())
        if silent_s <= SILENT_S:
            return row_of(child.name, node.report, state=state, cpu=cpu, memory_mb=memory_mb)
        state = f"silent for {silent_s:.0f} s"
    return Row(child.name, state, cpu=number(cpu), memory=number(memory_mb))


def _began_after(child: Child, node: NodeState) -> bool:
    """Tell whether a node of a child's name began after the child's end: somebody started it."""
    if node.report is None or child.state not in ("finished", "failed", "stopped"):
        return False
    now_ns = time.monotonic_ns()
    age_s = node.report_age_s(now_ns)
    began_s = now_ns / 1e9 - age_s - node.report.uptime_s
    return age_s <= SILENT_S and began_s > child.ended_s - TOLERANCE_S


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
        signal.signal(each, lambda number, _at: system.stop(number))
    try:
        with written_on_threads(), system.display:
            return system.run()
    except OSError as error:
        # The reader of our output is gone (`zv up | head`, a closed terminal), and all processes
        # have ended. The rest of the buffer must not fail again at exit.
        if not isinstance(error, BrokenPipeError) and error.errno != errno.EIO:
            raise
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
