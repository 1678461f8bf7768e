"""``zv doctor``: checks this machine, then the network."""

from __future__ import annotations

from zenoh_vision.errors import (
    ConfigurationError,
    ExpectationNotMet,
    RouterUnreachable,
    SourceError,
)
from zenoh_vision.transport.connection import Connection
from zenoh_vision.transport.zenoh_config import where
from zv.tools.doctor import access, network, streams
from zv.tools.doctor.expected import Expectation, expectation
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
    expected = expectation(options, connection)
    if expected is not None:
        connection = expected.connection
    diagnosis = Diagnosis(output)
    diagnosis.add(file_findings(options.files, connection.zenoh_config))
    diagnosis.add(device_findings())
    failed_here = diagnosis.failed
    try:
        with ToolSession(connection) as session:
            check_network(session, options.for_, diagnosis, expected)
            if session.stopping:
                return
    except RouterUnreachable as error:
        said, _, remedy = str(error).partition("; ")
        remedy = (expected and expected.router_remedy) or remedy
        diagnosis.add([Finding("FAIL", "router", said, remedy)])
        if not failed_here:
            raise type(error)(diagnosis.summary) from None
    except (ConfigurationError, SourceError) as error:
        diagnosis.add([Finding("FAIL", "router", f"not checked: {error}", "correct this first")])
    if diagnosis.failed:
        raise ExpectationNotMet(diagnosis.summary)
    output.note(diagnosis.summary)


def check_network(
    session: ToolSession,
    for_s: float,
    diagnosis: Diagnosis,
    expected: Expectation | None = None,
) -> None:
    """Observe the network for a time and check what was seen."""
    messages = MessageCheck(session)
    seen = observe(session, for_s)
    if session.stopping:
        return
    diagnosis.add(network.router_findings(seen, where(session.connection)))
    diagnosis.add(network.memory_findings(seen))
    denied: list[Finding] = []
    if session.credentials is not None:
        diagnosis.add(access.certificate_findings(session, session.credentials))
        denied = access.access_findings(session, session.credentials, seen)
        diagnosis.add(denied)
    diagnosis.add(network.namespace_findings(session, seen))
    diagnosis.add(network.misnamed_findings(session, seen))
    if expected is not None:
        diagnosis.add(expected.findings(seen))
    if not seen.nodes:
        if seen.others:
            diagnosis.add(streams.camera_findings(seen))
        return
    names = network.name_findings(seen)
    diagnosis.add(names)
    diagnosis.add(network.answer_findings(seen))
    diagnosis.add(network.version_findings(seen))
    diagnosis.add(network.clock_findings(seen))
    explained = {name for each in (*names, *denied) for name in each.nodes}
    for check in (streams.camera_findings, streams.loss_findings, streams.speed_findings):
        findings = list(check(seen))
        explained |= {name for each in findings if each.level != "OK" for name in each.nodes}
        diagnosis.add(findings)
    diagnosis.add(messages.findings())
    diagnosis.add(streams.health_findings(seen, explained))
