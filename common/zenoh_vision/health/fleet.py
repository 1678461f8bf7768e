"""The nodes of a namespace: which are alive, their descriptions and their health.

A model without network and clock: events and their times come in as arguments. An event takes
constant time, everything else time linear in the number of nodes.

Anyone can announce nodes, so their number and the size of their messages are limited. When there
are too many, nodes that neither described themselves nor report are left out first, the oldest
first. A node that has described itself is never left out for another while it lives.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

from zenoh_vision.error_text import shortened
from zenoh_vision.errors import PayloadError
from zenoh_vision.health.message_limits import (
    MAX_NAME,
    bounded_parameters,
    check,
    check_parameters,
)
from zenoh_vision.health.node_state import NodeState, S
from zenoh_vision.messages import Diagnostics, NodeDescription, Parameter

SILENT_S = 3.0
"""Diagnostics are sent once a second: a node without any for this long is stuck or cut off."""

GONE_S = 10.0
"""Without diagnostics for this long, a node that never had a liveliness token is gone."""

MAX_NODES = 1000
"""More nodes than any real system has: a mistake or an attack."""


@dataclass(frozen=True, slots=True)
class ParameterGone:
    """A parameter that a node has no more."""

    name: str


Event = bool | Diagnostics | Parameter | ParameterGone
"""Whether a node's token exists, its newest diagnostics, or a parameter that has changed or is
gone."""


def bounded(nodes: Iterable[NodeState]) -> tuple[list[NodeState], int]:
    """Return at most ``MAX_NODES`` nodes, those that answer first; and how many are left out."""
    ordered = sorted(nodes, key=lambda node: (not node.answered, node.order))
    return ordered[:MAX_NODES], max(0, len(ordered) - MAX_NODES)


class Fleet:
    """The nodes of a namespace, followed by events or by repeated snapshots of all of them.

    All times are nanoseconds of the same clock, which the caller chooses.

    Args:
        window_s: Diagnostics are kept that are at most this much older than the newest, by the
            node's uptime.
        forget_s: How long a node that is gone is listed.
    """

    def __init__(self, *, window_s: float = 0.0, forget_s: float = float("inf")) -> None:
        self._window_s = window_s
        self._forget_s = forget_s
        self._nodes: dict[tuple[str, str], NodeState] = {}
        self._by_rank: tuple[dict[tuple[str, str], None], ...] = ({}, {}, {}, {})
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
            PayloadError: ``too_many`` nodes that take precedence, ``too_large`` name.
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
        check(name, report)
        node = self.node(name)
        if node is None or not node.alive:
            if node is not None and node.has_token:
                return  # sent before the token went
            node = self._began(name, at_ns, REPORTS)
        self._put(node.with_report(report, at_ns, self._window_s))

    def describe(self, name: str, description: NodeDescription, at_ns: int = 0) -> bool:
        """Note a node's description; return whether there is such a node.

        A node that was left out is taken again.

        Raises:
            PayloadError: ``wrong_node``, ``too_large``, ``too_many`` nodes.
        """
        check(name, description)
        node = self.node(name)
        if node is None and (self.left_out or len(self._nodes) >= MAX_NODES):
            node = replace(self._began(name, at_ns, DESCRIBED), has_token=True)
        if node is None or not node.alive:
            return False
        self._put(replace(node, description=description, answered=True))
        return True

    def set_parameters(self, name: str, parameters: Iterable[Parameter]) -> bool:
        """Note all parameters of a node; return whether that is a change.

        Parameters beyond a limit, of size, number or total size, are left out.
        """
        node = self.node(name)
        found = bounded_parameters(parameters)
        if node is None or node.parameters == found:
            return False
        self._put(replace(node, parameters=found))
        return True

    def change_parameter(self, name: str, changed: Parameter) -> bool:
        """Apply a change of one parameter; return False if its revision is too old.

        Raises:
            PayloadError: ``wrong_node``, ``too_many`` parameters, ``too_large``.
        """
        check(name, changed)
        node = self.node(name)
        if node is None:
            return False
        before = node.parameters.get(changed.name)
        if before is not None and before.revision > changed.revision:
            return False
        parameters = {**node.parameters, changed.name: changed}
        check_parameters(name, parameters.values())
        self._put(replace(node, parameters=parameters))
        return True

    def remove_parameter(self, name: str, gone: ParameterGone) -> bool:
        """Remove a parameter that a node has no more; return whether it was known."""
        node = self.node(name)
        if node is None or gone.name not in node.parameters:
            return False
        left = {key: one for key, one in node.parameters.items() if key != gone.name}
        self._put(replace(node, parameters=left))
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
        """Apply a snapshot of all running nodes; return the nodes that appeared or disappeared.

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

    def _began(self, name: str, at_ns: int, rank: int = 0) -> NodeState:
        """Return the state of a node at the start of a run, without reports of earlier runs.

        If there are too many nodes, a new one replaces one of no higher rank.
        """
        node = self.node(name)
        if node is None:
            if len(name) > MAX_NAME:
                raise PayloadError("too_large", f"the name {shortened(name)} of a node")
            if len(self._nodes) >= MAX_NODES:
                self._make_room(name, rank)
            return NodeState(name, since_ns=at_ns)
        return replace(node, alive=True, since_ns=at_ns, answered=False, reports=())

    def _make_room(self, name: str, rank: int) -> None:
        """Leave out the oldest of the nodes of lowest rank, for one of at least that rank."""
        least = next(each for each in range(len(self._by_rank)) if self._by_rank[each])
        if least > rank or least == DESCRIBED:
            raise PayloadError("too_many", f"more than {MAX_NODES} nodes; {name!r} is one more")
        self._remove(next(iter(self._by_rank[least])))
        self.left_out += 1

    def _put(self, node: NodeState) -> None:
        key = _key(node)
        before, rank = self._nodes.get(key), _rank(node)
        if before is None or _rank(before) != rank:
            self._remove(key)
            self._by_rank[rank][key] = None
        self._nodes[key] = node

    def _remove(self, key: tuple[str, str]) -> None:
        self._nodes.pop(key, None)
        for those in self._by_rank:
            those.pop(key, None)


def _key(node: NodeState) -> tuple[str, str]:
    return node.name, node.session


SILENT, REPORTS, WENT, DESCRIBED = range(4)
"""Rank of a node, ascending: token only, reports, description but gone, description and alive."""


def _rank(node: NodeState) -> int:
    if node.description is not None:
        return DESCRIBED if node.alive else WENT
    return REPORTS if node.alive and node.reports else SILENT
