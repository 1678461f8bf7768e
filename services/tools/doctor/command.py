"""``zv doctor``: this machine first, then the network."""

from __future__ import annotations

import difflib
from collections import Counter
from collections.abc import Iterator

from common.connection import Connection
from common.errors import ConfigurationError, ExpectationNotMet, RouterUnreachable
from services.tools.doctor import nodes, router, streams
from services.tools.doctor.files import file_findings
from services.tools.doctor.finding import Diagnosis, Finding
from services.tools.doctor.machine import device_findings
from services.tools.doctor.options import DoctorOptions
from services.tools.doctor.survey import Survey, survey
from services.tools.namespaces import other_namespaces
from services.tools.output import Output
from services.tools.session import ToolSession


def run(options: DoctorOptions, connection: Connection, output: Output) -> None:
    """Print a line for each thing that was checked.

    Raises:
        RouterUnreachable: There is no router, and nothing else failed.
        ExpectationNotMet: Something else failed.
    """
    diagnosis = Diagnosis(output)
    diagnosis.add(file_findings(options.files, connection.zenoh_config))
    diagnosis.add(device_findings())
    failed_here = bool(diagnosis.failed())
    try:
        with ToolSession(connection) as session:
            look_around(session, options.for_, diagnosis)
            if session.stopping:
                return
    except RouterUnreachable as error:
        said, _, remedy = str(error).partition("; ")
        diagnosis.add([Finding("FAIL", "router", said, remedy)])
        if not failed_here:
            raise RouterUnreachable(summary(diagnosis)) from None
    except ConfigurationError as error:
        diagnosis.add([Finding("FAIL", "router", f"not looked for: {error}", "correct that first")])
    if diagnosis.failed():
        raise ExpectationNotMet(summary(diagnosis))
    output.note(summary(diagnosis))


def look_around(session: ToolSession, for_s: float, diagnosis: Diagnosis) -> None:
    """Add what the network tells."""
    found = survey(session, for_s)
    if session.stopping:
        return
    diagnosis.add(router.version_findings(found, session.connection.connect))
    diagnosis.add(router.memory_findings(found))
    diagnosis.add(namespace_findings(session, found))
    diagnosis.add(nodes.name_findings(found))
    diagnosis.add(nodes.answer_findings(found))
    diagnosis.add(nodes.version_findings(found))
    diagnosis.add(nodes.clock_findings(found))
    streams_of = [
        finding
        for findings in (
            streams.camera_findings(found),
            streams.loss_findings(found),
            streams.speed_findings(found),
        )
        for finding in findings
    ]
    diagnosis.add(streams_of)
    explained = {name for finding in streams_of if finding.level != "OK" for name in finding.nodes}
    diagnosis.add(streams.health_findings(found, explained))


def namespace_findings(session: ToolSession, found: Survey) -> Iterator[Finding]:
    """Judge whether this is the namespace that was meant."""
    if found.nodes:
        names = sorted({each.name for each in found.nodes})
        yield Finding("OK", "namespace", f"{session.namespace}: {', '.join(names)}")
        return
    others = other_namespaces(session)
    if not others:
        text = f"no node in namespace {session.namespace}, nor in any other"
        yield Finding("WARN", "namespace", text, "zv up starts a system")
        return
    there = "; ".join(f"{name}: {', '.join(nodes)}" for name, nodes in others.items())
    near = difflib.get_close_matches(session.namespace, others, 1, cutoff=0.0)[0]
    yield Finding(
        "FAIL",
        "namespace",
        f"no node in namespace {session.namespace}; there are nodes in {there}",
        f"--namespace {near}, or ZV_NAMESPACE={near}",
    )


def summary(diagnosis: Diagnosis) -> str:
    """Return how many lines there are of each level."""
    count = Counter(finding.level for finding in diagnosis.findings)
    return ", ".join(f"{count[level]} {level}" for level in ("OK", "WARN", "FAIL"))
