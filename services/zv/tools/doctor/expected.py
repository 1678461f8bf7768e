"""Checks that the nodes of a launch file run, and says how to start those that do not."""

from __future__ import annotations

import shlex
from dataclasses import dataclass, replace
from pathlib import Path

from zenoh_vision.errors import ConfigurationError
from zenoh_vision.transport.connection import Connection
from zenoh_vision.transport.endpoints import local_endpoint
from zv.launcher.command_line import service_flags
from zv.launcher.launch_file import (
    Plan,
    Planned,
    PlannedNode,
    PlannedProgram,
    read_launch_file,
    remapped_cameras,
)
from zv.tools.doctor.finding import Finding, or_ok
from zv.tools.doctor.observation import Observation
from zv.tools.doctor.options import DoctorOptions


@dataclass(frozen=True, slots=True)
class Expectation:
    """The nodes of a launch file that must run.

    Attributes:
        connection: Where they are looked for.
        remap: The given ``OLD=NEW`` of cameras, which the plan already follows.
    """

    plan: Plan
    connection: Connection
    remap: tuple[str, ...] = ()

    @property
    def router_remedy(self) -> str:
        """What to do if there is no router; empty if the file does not start one."""
        if self.connection.connect != _endpoint(Connection(), self.plan):
            return ""
        if "connect" in self.plan.connection:
            return ""
        return f"nothing of {self.plan.place} runs; {self._start_all()} starts all of it"

    def findings(self, seen: Observation) -> list[Finding]:
        """Find the nodes of the file that do not run.

        A program need not be a node: whether one that announces none runs is unknown here.
        """
        plan = self.plan
        announced = {each.name for each in seen.nodes}
        running = {each.name for each in seen.nodes if each.description is not None}
        names = tuple(node.name for node in plan.nodes)
        if announced.isdisjoint(names) and any(isinstance(n, PlannedNode) for n in plan.nodes):
            said = f"nothing of {plan.place} runs: {', '.join(names)}"
            start = self._start_all("--connect", self.connection.connect)
            return [Finding("FAIL", "expected", said, start, names)]
        problems = [
            self._problem(node, announced=node.name in announced)
            for node in plan.nodes
            if node.name not in running
        ]
        return or_ok(problems, "expected", f"all {len(names)} nodes of {plan.place} run")

    def _problem(self, node: Planned, *, announced: bool) -> Finding:
        named = f"{node.name} of {self.plan.place}"
        if announced:
            said, remedy = f"{named} does not answer", "it hangs: end it and start it again"
        elif isinstance(node, PlannedProgram):
            remedy = "if it should, see its log; zv up shows whether the program runs"
            return Finding(
                "WARN", "expected", f"{named} announces no node: not checked", remedy, (node.name,)
            )
        else:
            said = f"{named} does not run"
            remedy = f"it was not started, or its log says why it ended; {self._start_one(node)}"
        return Finding("FAIL", "expected", said, remedy, (node.name,))

    def _start_all(self, *words: str) -> str:
        """Return the command that starts the file, with further words."""
        remap = [word for each in self.remap for word in ("--remap", each)]
        command = ["zv", "up", self.plan.place, *remap, *words]
        if self.connection.namespace != self.plan.connection.get(
            "namespace", Connection().namespace
        ):
            command += ["--namespace", self.connection.namespace]
        return shlex.join(command)

    def _start_one(self, node: PlannedNode) -> str:
        """Return the command that starts a node as the file does, with placeholders for secrets."""
        flags, secrets = service_flags(node.service, node.settings)
        default, connection = Connection(), self.connection
        if connection.connect != default.connect:
            flags += ["--connect", connection.connect]
        if connection.namespace != default.namespace:
            flags += ["--namespace", connection.namespace]
        variables = [f"{name}=..." for name in secrets]
        return " ".join([*variables, shlex.join(["zv", *flags])])


def expectation(options: DoctorOptions, connection: Connection) -> Expectation | None:
    """Read the expected launch file, with its cameras renamed; None without a file.

    The router and the namespace are those of the file where the connection has the default.

    Raises:
        SourceError: The file cannot be opened.
        ConfigurationError: The file is wrong, or there is something to rename but no file.
    """
    if options.expect is None:
        if options.remap:
            raise ConfigurationError("--remap renames cameras of a launch file: give --expect too")
        return None
    plan = read_launch_file(Path(options.expect), remapped_cameras(options.remap))
    namespace = connection.namespace
    if namespace == Connection().namespace:
        namespace = plan.connection.get("namespace", namespace)
    found = replace(connection, connect=_endpoint(connection, plan), namespace=namespace)
    return Expectation(plan, found, options.remap)


def _endpoint(connection: Connection, plan: Plan) -> str:
    """Return the endpoint of a connection or, if that is the default, of a launch file."""
    if connection.connect != Connection().connect:
        return connection.connect
    listened = plan.listen and local_endpoint(plan.listen)
    return plan.connection.get("connect") or listened or connection.connect
