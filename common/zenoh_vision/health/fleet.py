"""The nodes of a namespace: which are alive, their descriptions and their health.

A model without network and clock: events and their times come in as arguments. An event takes
constant time, everything else time linear in the number of nodes.

Anyone can announce nodes, so there is a limit to their number and to the size of what each says.
When there are too many, those are left out first that never described themselves nor report, the
oldest first. A node that has described itself is never left out for another while it lives.
"""

from __future__ import annotations

import time
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace

from zenoh_vision.error_text import shortened
from zenoh_vision.errors import PayloadError
from zenoh_vision.health.counter_change import CounterChange, counter_change
from zenoh_vision.messages import Diagnostics, NodeDescription, Parameter

S = 1_000_000_000

SILENT_S = 3.0
"""Diagnostics are sent once a second: a node without any for this long is stuck or cut off."""

GONE_S = 10.0
"""Without diagnostics for this long, a node that never had a liveliness token is gone."""

MAX_NODES = 1000
MAX_COUNTERS = 100
MAX_PARAMETERS = 200
"""Limits for one node. No real system reaches them: more is a mistake or an attack."""

MAX_REPORTS = 8
"""Limit for one node. Of more within the fleet's window the first and the newest are kept."""

MAX_NAME = 512
MAX_REPORT = 16_000
MAX_PARAMETER = 8_000
MAX_DESCRIPTION = 64_000
"""Limits of the characters in all texts of one message; each text counts ``TEXT`` more."""

MAX_ALL_PARAMETERS = 64_000
"""Limit of those in all parameters of one node, so that 1000 nodes take 64 MB and not 1.6 GB."""

TEXT = 64

Event = bool | Diagnostics | Parameter
"""Whether a node's token exists, its newest diagnostics, or a parameter that has changed."""


@dataclass(frozen=True, slots=True)
class ClockOffset:
    """How far a node's clock is ahead of ours, measured by one query.

    Attributes:
        ahead_ns: Nanoseconds; negative if it is behind.
        error_ns: Half the round trip, by which the offset may be wrong.
    """

    ahead_ns: int
    error_ns: int


@dataclass(frozen=True, slots=True)
class NodeState:
    """What is known of one node.

    Attributes:
        session: Zenoh id of the session that answered for it, which distinguishes two nodes of
            one name; empty if nodes are followed by their tokens, since these two share one.
        since_ns: When it last appeared or disappeared.
        has_token: Whether it ever had a liveliness token; if not, its diagnostics are its only
            sign of life.
        answered: Whether it has described itself in this run, or when last asked.
        description: The newest one, perhaps from its former run.
        reports: Its diagnostics within the fleet's window, the newest last.
        reported_ns: When the newest arrived.
        clock: Its clock compared with ours, by its quickest answer.
    """

    name: str
    session: str = ""
    alive: bool = True
    since_ns: int = 0
    has_token: bool = False
    answered: bool = False
    description: NodeDescription | None = None
    reports: tuple[Diagnostics, ...] = ()
    reported_ns: int = 0
    clock: ClockOffset | None = None
    parameters: Mapping[str, Parameter] = field(default_factory=dict)

    @property
    def report(self) -> Diagnostics | None:
        """Its newest diagnostics in this run."""
        return self.reports[-1] if self.reports else None

    @property
    def change(self) -> CounterChange | None:
        """What its counters counted within the fleet's window; None before two diagnostics."""
        if len(self.reports) < 2:
            return None
        first, last = self.reports[0], self.reports[-1]
        return counter_change(first.counters, last.counters, last.uptime_s - first.uptime_s)

    @property
    def silent_s(self) -> float | None:
        """Seconds from its newest diagnostics to its description, by its own clock."""
        if self.report is None or self.description is None:
            return None
        return max(0, self._described_ns(self.description) - self.report.stamp_ns) / S

    @property
    def uptime_s(self) -> float | None:
        """Seconds from its start to its description, by its own clock."""
        if self.description is None:
            return None
        return max(0, self._described_ns(self.description) - self.description.started_ns) / S

    @property
    def order(self) -> tuple[str, int, str]:
        """Key to sort by: the name, the start, the session."""
        return self.name, self.description.started_ns if self.description else 0, self.session

    def report_age_s(self, at_ns: int) -> float:
        """Return the seconds since its newest diagnostics arrived."""
        return max(0, at_ns - self.reported_ns) / S

    def with_report(self, report: Diagnostics, at_ns: int, window_s: float) -> NodeState:
        """Return the state after diagnostics that arrived at a time."""
        kept = self.reports
        if kept and report.uptime_s < kept[-1].uptime_s:
            kept = ()  # started again
        uptime_s = report.uptime_s  # replaces a report of the same uptime
        kept = tuple(r for r in kept if uptime_s - window_s <= r.uptime_s < uptime_s)
        if len(kept) >= MAX_REPORTS:
            kept = (kept[0], *kept[len(kept) + 2 - MAX_REPORTS :])
        return replace(self, reports=(*kept, report), reported_ns=at_ns)

    @staticmethod
    def _described_ns(description: NodeDescription) -> int:
        return description.stamp_ns or time.time_ns()


def bounded(nodes: Iterable[NodeState]) -> tuple[list[NodeState], int]:
    """Return at most ``MAX_NODES`` nodes, those that answer first; and how many are left out."""
    ordered = sorted(nodes, key=lambda node: (not node.answered, node.order))
    return ordered[:MAX_NODES], max(0, len(ordered) - MAX_NODES)


class Fleet:
    """The nodes of a namespace, followed by events or by repeated snapshots of all of them.

    All times are nanoseconds of the same clock, which the caller chooses.

    Args:
        window_s: How much older than a node's newest diagnostics, by its uptime, those may be that
            are kept too.
        forget_s: How long a node that is gone is listed.
    """

    def __init__(self, *, window_s: float = 0.0, forget_s: float = float("inf")) -> None:
        self._window_s = window_s
        self._forget_s = forget_s
        self._nodes: dict[tuple[str, str], NodeState] = {}
        self._by_worth: tuple[dict[tuple[str, str], None], ...] = ({}, {}, {}, {})
        self._asked_ns: dict[str, int] = {}
        self.left_out = 0
        """How many nodes were left out for others, since the beginning."""

    def node(self, name: str) -> NodeState | None:
        """Return a node that is followed by events."""
        return self._nodes.get((name, ""))

    def nodes(self) -> list[NodeState]:
        """Return all nodes by name, those of one name by their start."""
        return sorted(self._nodes.values(), key=lambda node: node.order)

    def forget(self, name: str) -> None:
        """Remove a node that is followed by events."""
        self._remove((name, ""))

    # Events

    def token(self, name: str, there: bool, at_ns: int) -> bool:
        """Note that a node's token appeared or disappeared; return whether that is a change.

        Raises:
            PayloadError: ``too_many`` nodes that have told more of themselves, ``too_large`` name.
        """
        before = self.node(name)
        if before is None and not there:
            return False
        if before is not None and before.alive == there:
            self._put(replace(before, has_token=True))
            return False
        node = before if before is not None and not there else self._began(name, at_ns)
        self._put(replace(node, alive=there, since_ns=at_ns, has_token=True))
        return True

    def report(self, name: str, report: Diagnostics, at_ns: int) -> None:
        """Note a node's diagnostics, which show that it runs unless its token has disappeared.

        Raises:
            PayloadError: ``wrong_node``, ``too_many`` nodes or counters, ``too_large``.
        """
        check_report(name, report)
        node = self.node(name)
        if node is None or not node.alive:
            if node is not None and node.has_token:
                return  # sent before the token went
            node = self._began(name, at_ns, REPORTS)
        self._put(node.with_report(report, at_ns, self._window_s))

    def describe(self, name: str, description: NodeDescription, at_ns: int = 0) -> bool:
        """Note a node's description; return whether there is such a node.

        One that was left out for others is taken again.

        Raises:
            PayloadError: ``wrong_node``, ``too_large``, ``too_many`` nodes.
        """
        check_description(name, description)
        node = self.node(name)
        if node is None and (self.left_out or len(self._nodes) >= MAX_NODES):
            node = replace(self._began(name, at_ns, DESCRIBED), has_token=True)
        if node is None or not node.alive:
            return False
        self._put(replace(node, description=description, answered=True))
        return True

    def set_parameters(self, name: str, parameters: Iterable[Parameter]) -> bool:
        """Note all parameters of a node; return whether that is a change.

        Those that are too large, too many, or too much together, are left out.
        """
        node = self.node(name)
        found: dict[str, Parameter] = {}
        left = MAX_ALL_PARAMETERS
        for each in parameters:
            size = _size(_texts(each))
            if size <= min(MAX_PARAMETER, left) and len(found) < MAX_PARAMETERS:
                left -= size
                found[each.name] = each
        if node is None or node.parameters == found:
            return False
        self._put(replace(node, parameters=found))
        return True

    def change_parameter(self, name: str, changed: Parameter) -> bool:
        """Take a change of one parameter; return whether it holds: an older revision does not.

        Raises:
            PayloadError: ``wrong_node``, ``too_many`` parameters, ``too_large``.
        """
        _check(name, changed.node)
        node = self.node(name)
        if node is None:
            return False
        _check_size("parameter", name, MAX_PARAMETER, _texts(changed))
        before = node.parameters.get(changed.name)
        if before is None and len(node.parameters) >= MAX_PARAMETERS:
            raise PayloadError("too_many", f"more than {MAX_PARAMETERS} parameters of {name!r}")
        if before is not None and before.revision > changed.revision:
            return False
        parameters = {**node.parameters, changed.name: changed}
        if sum(_size(_texts(each)) for each in parameters.values()) > MAX_ALL_PARAMETERS:
            raise PayloadError("too_large", f"all parameters of {shortened(name)} together")
        self._put(replace(node, parameters=parameters))
        return True

    def expire(self, at_ns: int) -> bool:
        """Mark silent nodes without tokens as gone, and remove nodes that are gone for long.

        Returns:
            Whether a node was removed.
        """
        count = len(self._nodes)
        for key, node in list(self._nodes.items()):
            ended_ns = node.since_ns
            if node.alive:
                if node.has_token or node.report_age_s(at_ns) <= GONE_S:
                    continue
                ended_ns = node.reported_ns + int(GONE_S * S)
                self._put(replace(node, alive=False, since_ns=ended_ns))
            if at_ns - ended_ns > self._forget_s * S:
                self._remove(key)
        return len(self._nodes) < count

    def to_ask(self, at_ns: int, again_s: float) -> list[str]:
        """Return the nodes to ask for a description now: names, or ``*`` alone for many.

        A node that does not answer is asked again after ``again_s``.
        """
        undescribed = (n.name for n in self._nodes.values() if n.alive and not n.answered)
        asked = {name: self._asked_ns.get(name) for name in undescribed}
        due = [n for n, ns in asked.items() if ns is None or at_ns - ns >= again_s * S]
        self._asked_ns = {n: ns for n, ns in asked.items() if ns is not None}
        self._asked_ns |= dict.fromkeys(due, at_ns)
        return ["*"] if len(due) > 1 and 4 * len(due) >= len(self._nodes) else due

    # Snapshots

    def update(self, found: Iterable[NodeState]) -> tuple[list[NodeState], list[NodeState]]:
        """Note a snapshot of all running nodes, and return the nodes that came and that went.

        If a name has a token but no node answers, the known nodes of this name are kept as not
        answering, since they may be busy.

        Args:
            found: The nodes that queries found, each with at most its newest diagnostics.
        """
        found = bounded(found)[0]
        before = self._nodes
        unanswered = {node.name for node in found if not node.answered}
        kept = {
            key: replace(node, answered=False)
            for key, node in before.items()
            if node.name in unanswered and node.description is not None
        }
        busy = {name for name, _ in kept}
        self._nodes = {
            _key(node): self._merged(before.get(_key(node)), node)
            for node in found
            if node.answered or node.name not in busy
        } | kept
        came = [node for key, node in self._nodes.items() if key not in before]
        went = [node for key, node in before.items() if key not in self._nodes]
        return came, went

    def _merged(self, known: NodeState | None, node: NodeState) -> NodeState:
        if known is None:
            return node
        if node.report is not None:
            merged = replace(known, reports=known.reports if node.reports else ())
            reports = merged.with_report(node.report, 0, self._window_s).reports
            node = replace(node, reports=reports)
        clocks = [clock for clock in (known.clock, node.clock) if clock is not None]
        return replace(node, clock=min(clocks, key=lambda clock: clock.error_ns, default=None))

    def _began(self, name: str, at_ns: int, worth: int = 0) -> NodeState:
        """Return the state of a node at the start of a run, without reports of earlier runs.

        If there are too many nodes, a new one replaces one that is worth no more.
        """
        node = self.node(name)
        if node is None:
            if len(name) > MAX_NAME:
                raise PayloadError("too_large", f"the name {shortened(name)} of a node")
            if len(self._nodes) >= MAX_NODES:
                self._make_room(name, worth)
            return NodeState(name, since_ns=at_ns)
        return replace(node, alive=True, since_ns=at_ns, answered=False, reports=())

    def _make_room(self, name: str, worth: int) -> None:
        """Leave out the oldest of the nodes that are worth least, for one of a certain worth."""
        least = next(each for each in range(len(self._by_worth)) if self._by_worth[each])
        if least > worth or least == DESCRIBED:
            raise PayloadError("too_many", f"more than {MAX_NODES} nodes; {name!r} is one more")
        self._remove(next(iter(self._by_worth[least])))
        self.left_out += 1

    def _put(self, node: NodeState) -> None:
        key = _key(node)
        before, worth = self._nodes.get(key), _worth(node)
        if before is None or _worth(before) != worth:
            self._remove(key)
            self._by_worth[worth][key] = None
        self._nodes[key] = node

    def _remove(self, key: tuple[str, str]) -> None:
        self._nodes.pop(key, None)
        for those in self._by_worth:
            those.pop(key, None)


def _key(node: NodeState) -> tuple[str, str]:
    return node.name, node.session


SILENT, REPORTS, WENT, DESCRIBED = range(4)
"""How much a node is worth: a token alone, reports, a description of one that is gone, one."""


def _worth(node: NodeState) -> int:
    if node.description is not None:
        return DESCRIBED if node.alive else WENT
    return REPORTS if node.alive and node.reports else SILENT


def check_report(name: str, report: Diagnostics) -> None:
    """Check diagnostics that a node sends.

    Raises:
        PayloadError: ``wrong_node``, ``too_many`` counters, ``too_large``.
    """
    _check(name, report.node)
    if len(report.counters) > MAX_COUNTERS:
        raise PayloadError("too_many", f"{len(report.counters)} counters of {shortened(name)}")
    _check_size("report", name, MAX_REPORT, (report.message, *report.counters))


def check_description(name: str, description: NodeDescription) -> None:
    """Check a description that a node gives of itself.

    Raises:
        PayloadError: ``wrong_node``, ``too_large``.
    """
    _check(name, description.node)
    about = description
    texts = (about.service, about.version, about.host)
    listed = (*about.cameras, *about.publishes, *about.subscribes)
    _check_size("description", name, MAX_DESCRIPTION, (*texts, *listed))


def _texts(parameter: Parameter) -> tuple[str, ...]:
    one = parameter
    texts = (one.name, one.type, one.unit, one.description, one.value, one.default)
    return *(each for each in texts if isinstance(each, str)), *(one.choices or ())


def _size(texts: Iterable[str]) -> int:
    # Python takes up to four bytes for each character of a text that has one outside ASCII.
    return sum(TEXT + len(text) * (1 if text.isascii() else 4) for text in texts)


def _check_size(what: str, name: str, most: int, texts: Iterable[str]) -> None:
    if _size(texts) > most:
        raise PayloadError("too_large", f"the {what} of {shortened(name)}")


def _check(name: str, said: str) -> None:
    if name != said:
        here, there = shortened(said), shortened(name)
        raise PayloadError("wrong_node", f"a message of {here} on the key of {there}")
