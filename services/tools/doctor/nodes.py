"""Checks of the nodes as such: their names, versions, clocks, and whether they answer."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Iterator
from itertools import groupby

from common.description import installed_version
from services.figures.board import SILENT_S
from services.tools.doctor.finding import Finding
from services.tools.doctor.survey import Survey
from services.tools.facts import duration
from services.tools.nodes import SILENT, Presence

APART_NS = 50_000_000
REFUSED_NS = 24 * 3600 * 1_000_000_000
"""Receivers refuse stamps that are further ahead."""


def name_findings(survey: Survey) -> Iterator[Finding]:
    """Find nodes of one name: their frames and their health are mixed up."""
    twice = False
    for name, group in groupby(survey.nodes, key=lambda each: each.name):
        nodes = list(group)
        if len(nodes) > 1:
            twice = True
            yield Finding(
                "FAIL",
                "names",
                f"{len(nodes)} nodes are called {name}: {', '.join(map(_place, nodes))}",
                "stop all but one, or give each a --camera of its own",
                (name,),
            )
    if survey.nodes and not twice:
        yield Finding("OK", "names", f"{_count(survey.nodes)}, each of another name")


def answer_findings(survey: Survey) -> Iterator[Finding]:
    """Find nodes that are there but do not work."""
    well = True
    for each in survey.nodes:
        silent_s = each.silent_s
        if each.description is None:
            well = False
            yield Finding(
                "FAIL",
                "answers",
                f"{each.name} {SILENT}",
                "it hangs or its machine is overloaded: see its log, end it and start it again",
                (each.name,),
            )
        elif silent_s is not None and silent_s > SILENT_S:
            well = False
            yield Finding(
                "FAIL",
                "answers",
                f"{each.name} has not reported its health for {silent_s:.0f} s",
                "its machine is overloaded, or it hangs: see its log",
                (each.name,),
            )
    if survey.nodes and well:
        yield Finding("OK", "answers", "all nodes answer and report their health")


def version_findings(survey: Survey) -> Iterator[Finding]:
    """Find nodes of different versions; this tool's own counts."""
    by_version: dict[str, set[str]] = defaultdict(set)
    for each in survey.nodes:
        if each.description is not None:
            by_version[each.description.version].add(each.name)
    if not by_version:
        return
    nodes = tuple(sorted(set().union(*by_version.values())))
    by_version[installed_version()].add("this zv")
    if len(by_version) == 1:
        yield Finding("OK", "versions", f"all nodes and this zv are {installed_version()}")
        return
    shown = "; ".join(
        f"{version}: {', '.join(sorted(names))}" for version, names in sorted(by_version.items())
    )
    yield Finding(
        "WARN", "versions", f"versions differ: {shown}", "install one version everywhere", nodes
    )


def clock_findings(survey: Survey) -> Iterator[Finding]:
    """Compare the clocks of the nodes' machines with ours."""
    apart: dict[str, list[tuple[str, int, int]]] = defaultdict(list)
    errors = []
    for each in survey.nodes:
        clock = survey.clocks.get((each.name, each.session))
        if clock is None or each.description is None:
            continue
        errors.append(clock.error_ns)
        if abs(clock.ahead_ns) - clock.error_ns > APART_NS:
            apart[each.description.host].append((each.name, clock.ahead_ns, clock.error_ns))
    for host, nodes in sorted(apart.items()):
        _, ahead_ns, error_ns = min(nodes, key=lambda node: node[2])
        names = tuple(sorted({name for name, _, _ in nodes}))
        refused = ahead_ns > REFUSED_NS
        yield Finding(
            "FAIL" if refused else "WARN",
            "clocks",
            f"the clock of {host} ({', '.join(names)}) is {ahead_ns / 1e9:+.3f} s from this "
            f"machine's, give or take {error_ns / 1e6:.1f} ms: "
            + ("its frames are refused" if refused else "latencies are wrong by as much"),
            "keep both machines' clocks with NTP or PTP (chrony, systemd-timesyncd)",
            names,
        )
    if errors and not apart:
        yield Finding(
            "OK",
            "clocks",
            f"all clocks agree within {APART_NS / 1e6:.0f} ms (measured to "
            f"{max(errors) / 1e6:.1f} ms)",
        )


def _place(presence: Presence) -> str:
    about = presence.description
    if about is None:
        return "one that does not answer"
    return f"pid {about.pid} on {about.host} (up {duration(presence.uptime_s)})"


def _count(nodes: Iterable[Presence]) -> str:
    count = len(list(nodes))
    return f"{count} node{'s' if count > 1 else ''}"
