"""Checks of the network: router, shared memory, namespace; nodes' names, versions and clocks."""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Iterator
from importlib.metadata import version as installed
from itertools import groupby

from zenoh_vision.error_text import joined, shortened, similar_names
from zenoh_vision.health.fleet import SILENT_S
from zenoh_vision.health.node_state import ClockOffset, NodeState
from zenoh_vision.topics import misnamed_camera
from zenoh_vision.version import installed_version
from zv.tools.doctor.finding import Finding, or_ok
from zv.tools.doctor.observation import Observation
from zv.tools.shared.discovery import other_namespaces
from zv.tools.shared.nodes import NO_ANSWER, duration, place
from zv.tools.shared.session import ToolSession

MAX_KEYS = 2000
FEW_NAMES = 12
"""More tokens without nodes are combined into one finding."""

APART_NS = 50_000_000
REFUSED_NS = 24 * 3600 * 1_000_000_000
"""Receivers refuse stamps that are further ahead than this."""

BINDING = "eclipse-zenoh"
LOOK_IN = "enable its admin space: adminspace: { enabled: true } in its configuration"
SWITCH_OFF = (
    "transport: { shared_memory: { enabled: false } } in the configuration of the router and of "
    "those programs: it leaks locked memory in the router (zenoh #2787)"
)


def router_findings(seen: Observation, endpoint: str) -> Iterator[Finding]:
    """Check the routers that this tool is connected to."""
    if not seen.reached:
        said = f"the connection to the router at {endpoint} was lost"
        yield Finding("FAIL", "router", said, "see its log; start it again")
    for zid in seen.reached:
        router = seen.routers.get(zid)
        if router is None or router.version is None:
            yield Finding("OK", "router", f"reached at {endpoint}, version unknown", LOOK_IN)
            continue
        ours = installed(BINDING)
        said = f"zenoh {router.version} at {endpoint}"
        if router.version.split(".")[:2] == ours.split(".")[:2]:
            yield Finding("OK", "router", said)
        else:
            remedy = "install the same minor version on both sides"
            yield Finding("WARN", "router", f"{said}, but {BINDING} {ours} here", remedy)


def memory_findings(seen: Observation) -> Iterator[Finding]:
    """Find sessions that share memory with a router, which is Zenoh's default."""
    if not seen.routers:
        yield Finding("OK", "memory", "unknown whether memory is shared", LOOK_IN)
        return
    names = {each.session: each.name for each in seen.nodes}
    sharing = [names.get(zid, zid) for r in seen.routers.values() for zid in r.sharing]
    if sharing:
        said = (
            f"Zenoh's own shared memory is on between the router and {', '.join(sorted(sharing))}"
        )
        yield Finding("WARN", "memory", said, SWITCH_OFF)
    else:
        yield Finding("OK", "memory", "no session of the router uses Zenoh's own shared memory")


def namespace_findings(session: ToolSession, seen: Observation) -> Iterator[Finding]:
    """Check that the namespace has nodes; if not, name the namespaces that have nodes."""
    if seen.nodes:
        answering = {each.name for each in seen.nodes if each.description is not None}
        silent = {each.name for each in seen.nodes} - answering
        names = joined([*sorted(answering), *sorted(silent)], max(FEW_NAMES, len(answering)))
        yield Finding("OK", "namespace", f"{session.namespace}: {names}")
        return
    others = other_namespaces(session)
    none = f"no node in namespace {session.namespace}"
    if not others:
        yield Finding("WARN", "namespace", f"{none}, nor in any other", "zv up starts a system")
        return
    there = "; ".join(f"{name}: {', '.join(nodes)}" for name, nodes in others.items())
    (near,) = similar_names(session.namespace, others, similarity=0.0)
    remedy = f"--namespace {near}, or ZV_NAMESPACE={near}"
    yield Finding("FAIL", "namespace", f"{none}; there are nodes in {there}", remedy)


def name_findings(seen: Observation) -> list[Finding]:
    """Find nodes of the same name, whose frames and health are mixed up."""
    problems = []
    for name, group in groupby(seen.nodes, key=lambda each: each.name):
        twins = list(group)
        if len(twins) > 1:
            said = f"{len(twins)} nodes are called {name}: {', '.join(map(_place, twins))}"
            remedy = "stop all but one"
            if any(each.description and each.description.cameras for each in twins):
                remedy += ", or give each a --camera of its own"
            problems.append(Finding("FAIL", "names", said, remedy, (name,)))
    count = len(seen.nodes)
    nodes = f"{count} node{'s' if count > 1 else ''}"
    return or_ok(problems, "names", f"{nodes}, all with different names")


def misnamed_findings(session: ToolSession, seen: Observation) -> Iterator[Finding]:
    """Find streams of frames whose camera's name is none: nothing of zv shows or takes them."""
    for key in sorted(seen.discovery.publishers)[:MAX_KEYS]:
        if camera := misnamed_camera(key, session.namespace):
            said = f"someone publishes {key}, but {shortened(camera)} is no name of a camera"
            remedy = f"rename it: letters a-z, digits and _ are allowed, such as {_as_name(camera)}"
            yield Finding("FAIL", "names", said, remedy)


def _as_name(text: str) -> str:
    return re.sub(r"[^a-z0-9_]", "_", text.lower())[:64]


def answer_findings(seen: Observation) -> list[Finding]:
    """Find nodes that run but do not respond."""
    problems = []
    silent = [each.name for each in seen.nodes if each.description is None]
    if len(silent) > FEW_NAMES:
        count = len(silent) + seen.left_out
        said = f"{count} tokens are shown by nodes that do not answer: {joined(silent, FEW_NAMES)}"
        remedy = "some program invents nodes: find and end it"
        problems.append(Finding("FAIL", "answers", said, remedy, tuple(silent)))
    for each in seen.nodes:
        silent_s = each.silent_s
        if each.description is None:
            if len(silent) > FEW_NAMES:
                continue
            said = f"{each.name} {NO_ANSWER}"
            remedy = "it hangs or its machine is overloaded: see its log, end it and start it again"
        elif silent_s is not None and silent_s > SILENT_S:
            said = f"{each.name} has not reported its health for {silent_s:.0f} s"
            remedy = "its machine is overloaded, or it hangs: see its log"
        else:
            continue
        problems.append(Finding("FAIL", "answers", said, remedy, (each.name,)))
    return or_ok(problems, "answers", "all nodes answer and report their health")


def version_findings(seen: Observation) -> Iterator[Finding]:
    """Find nodes with different versions, or with another version than this tool."""
    by_version: dict[str, set[str]] = defaultdict(set)
    for each in seen.nodes:
        if each.description is not None:
            by_version[each.description.version].add(each.name)
    if not by_version:
        return
    nodes = tuple(sorted(set().union(*by_version.values())))
    by_version[installed_version()].add("this zv")
    if len(by_version) == 1:
        yield Finding("OK", "versions", f"all nodes and this zv are {installed_version()}")
        return
    texts = (
        f"{version}: {', '.join(sorted(by_version[version]))}" for version in sorted(by_version)
    )
    said = f"versions differ: {'; '.join(texts)}"
    yield Finding("WARN", "versions", said, "install one version everywhere", nodes)


def clock_findings(seen: Observation) -> Iterator[Finding]:
    """Compare the clocks of the nodes' machines with this one's."""
    apart: dict[str, list[tuple[ClockOffset, str]]] = defaultdict(list)
    errors_ns = []
    for each in seen.nodes:
        clock = each.clock
        if clock is None or each.description is None:
            continue
        errors_ns.append(clock.error_ns)
        if abs(clock.ahead_ns) - clock.error_ns > APART_NS:
            apart[each.description.host].append((clock, each.name))
    for host, measured in sorted(apart.items()):
        best = min((clock for clock, _ in measured), key=lambda clock: clock.error_ns)
        names = tuple(sorted({name for _, name in measured}))
        refused = best.ahead_ns > REFUSED_NS
        yield Finding(
            "FAIL" if refused else "WARN",
            "clocks",
            f"the clock of {host} ({', '.join(names)}) is {best.ahead_ns / 1e9:+.3f} s from this "
            f"machine's (measured to {best.error_ns / 1e6:.1f} ms): "
            + ("its frames are refused" if refused else "latencies are wrong by this amount"),
            "synchronize both machines' clocks with NTP or PTP (chrony, systemd-timesyncd)",
            names,
        )
    if errors_ns and not apart:
        within = f"{APART_NS / 1e6:.0f} ms (measured to {max(errors_ns) / 1e6:.1f} ms)"
        yield Finding("OK", "clocks", f"all clocks agree within {within}")


def _place(node: NodeState) -> str:
    about = node.description
    if about is None:
        return "one that does not answer"
    return f"{place(about)} (up {duration(node.uptime_s)})"
