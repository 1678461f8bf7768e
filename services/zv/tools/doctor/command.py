"""``zv doctor``: checks this machine, then the network."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from zenoh_vision.errors import ConfigurationError, ExpectationNotMet, RouterUnreachable
from zenoh_vision.transport.connection import Connection
from zenoh_vision.transport.endpoints import local_endpoint
from zv.launcher.launch_file import Plan, read_launch_file, remapped_cameras
from zv.tools.doctor import network, streams
from zv.tools.doctor.finding import Diagnosis, Finding
from zv.tools.doctor.machine import device_findings, file_findings
from zv.tools.doctor.messages import MessageCheck
from zv.tools.doctor.observation import observe
from zv.tools.doctor.options import DoctorOptions
from zv.tools.shared.output import Output
from zv.tools.shared.session import ToolSession


def run(options: DoctorOptions, connection: Connection, output: Output) -> None:
    """Print a line for each check.

    The namespace and router of an expected launch file are used, unless others are given.

    Raises:
        ConfigurationError: The expected launch file is wrong, or ``remap`` is.
        RouterUnreachable: There is no router, and nothing else failed.
        ExpectationNotMet: Something else failed.
    """
    plan = expected_plan(options)
    if plan is not None:
        connection = _of_plan(connection, plan)
    diagnosis = Diagnosis(output)
    diagnosis.add(file_findings(options.files, connection.zenoh_config))
    diagnosis.add(device_findings())
    failed_here = diagnosis.failed
    try:
        with ToolSession(connection) as session:
            check_network(session, options.for_, diagnosis, plan)
            if session.stopping:
                return
    except RouterUnreachable as error:
        said, _, remedy = str(error).partition("; ")
        diagnosis.add([Finding("FAIL", "router", said, remedy)])
        if not failed_here:
            raise RouterUnreachable(diagnosis.summary) from None
    except ConfigurationError as error:
        diagnosis.add([Finding("FAIL", "router", f"not checked: {error}", "correct this first")])
    if diagnosis.failed:
        raise ExpectationNotMet(diagnosis.summary)
    output.note(diagnosis.summary)


def expected_plan(options: DoctorOptions) -> Plan | None:
    """Return the expected launch file with its cameras renamed; None if none is given.

    Raises:
        ConfigurationError: It is wrong, or there is something to rename but no file.
    """
    if options.expect is not None:
        return read_launch_file(Path(options.expect), remapped_cameras(options.remap))
    if options.remap:
        raise ConfigurationError("--remap renames cameras of a launch file: give --expect too")
    return None


def _of_plan(connection: Connection, plan: Plan) -> Connection:
    """Return the connection with what the launch file states where it has the default."""
    default = Connection()
    connect, namespace = connection.connect, connection.namespace
    if connect == default.connect:
        listened = plan.listen and local_endpoint(plan.listen)
        connect = plan.connection.get("connect") or listened or connect
    if namespace == default.namespace:
        namespace = plan.connection.get("namespace", namespace)
    return replace(connection, connect=connect, namespace=namespace)


def check_network(
    session: ToolSession, for_s: float, diagnosis: Diagnosis, plan: Plan | None = None
) -> None:
    """Observe the network for a time and check what was seen."""
    messages = MessageCheck(session)
    seen = observe(session, for_s)
    if session.stopping:
        return
    diagnosis.add(network.router_findings(seen, session.connection.connect))
    diagnosis.add(network.memory_findings(seen))
    diagnosis.add(network.namespace_findings(session, seen))
    if plan is not None:
        diagnosis.add(network.expected_findings(seen, plan))
    if not seen.nodes:
        if seen.others:
            diagnosis.add(streams.camera_findings(seen))
        return
    names = network.name_findings(seen)
    diagnosis.add(names)
    diagnosis.add(network.answer_findings(seen))
    diagnosis.add(network.version_findings(seen))
    diagnosis.add(network.clock_findings(seen))
    explained = {name for each in names for name in each.nodes}
    for check in (streams.camera_findings, streams.loss_findings, streams.speed_findings):
        findings = list(check(seen))
        explained |= {name for each in findings if each.level != "OK" for name in each.nodes}
        diagnosis.add(findings)
    diagnosis.add(messages.findings())
    diagnosis.add(streams.health_findings(seen, explained))
