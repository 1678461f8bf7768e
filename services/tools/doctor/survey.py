"""What the network tells: the router, and the nodes watched for a few seconds."""

from __future__ import annotations

import json
import time
from dataclasses import dataclass, field
from typing import Any, cast

from common.messages import NodeDescription, Parameter
from services.figures.change import Change
from services.tools.history import History
from services.tools.nodes import Clock, Presence, every_answer_on, parameters, present
from services.tools.session import ROUTERS, ToolSession

LOOK_S = 0.5


@dataclass(frozen=True, slots=True)
class Router:
    """What a router says of itself in its admin space.

    Attributes:
        zid: Zenoh id.
        version: Of Zenoh, ``1.10.2``; None if it is said in another form.
        sharing: Zenoh ids of the sessions that it shares memory with.
    """

    zid: str
    version: str | None
    sharing: tuple[str, ...]


@dataclass(slots=True)
class Survey:
    """All that was seen.

    Attributes:
        routers: Those that let one look, by id.
        reached: Ids of the routers we are still connected to at the end.
        nodes: Every node that was there at the last look.
        clocks: The clock of each node, from its quickest answer.
        parameters: By node and name; empty if no node answers for its parameters.
        history: Reports of the nodes while they were watched.
    """

    routers: dict[str, Router] = field(default_factory=dict)
    reached: tuple[str, ...] = ()
    nodes: list[Presence] = field(default_factory=list)
    clocks: dict[tuple[str, str | None], Clock] = field(default_factory=dict)
    parameters: dict[tuple[str, str], Parameter] = field(default_factory=dict)
    history: History = field(default_factory=lambda: History(float("inf")))

    def change(self, presence: Presence) -> Change | None:
        """Return what a node's counters did while it was watched."""
        return self.history.change(presence)

    def value(self, node: str, parameter: str) -> float | None:
        """Return the number that a parameter has now; None if that is unknown or no number."""
        known = self.parameters.get((node, parameter))
        if known is not None and type(known.value) in (int, float):
            return cast("float", known.value)
        if parameter == "rate":
            return next((d.rate_hz for d in self._described(node) if d.rate_hz), None)
        return None

    def _described(self, node: str) -> list[NodeDescription]:
        return [n.description for n in self.nodes if n.name == node and n.description]

    def publishers_of(self, key: str) -> list[str]:
        """Return the names of the nodes that publish a key."""
        publishing = (n for n in self.nodes if n.description and key in n.description.publishes)
        return sorted({node.name for node in publishing})

    def cameras(self) -> list[Presence]:
        """Return the cameras that answer."""
        return [n for n in self.nodes if n.description and n.description.service == "camera"]

    def camera_names(self) -> list[str]:
        """Return what the cameras are called that keys begin with: ``front``."""
        described = (n.description for n in self.cameras() if n.description)
        return sorted({name for description in described for name in description.cameras})


def survey(session: ToolSession, for_s: float) -> Survey:
    """Watch the nodes for so long, and ask the router."""
    found = Survey()
    (answers,) = session.gather(every_answer_on(session, ROUTERS))
    for answer in answers:
        zid = str(answer.sample.key_expr).split("/")[1]
        found.routers[zid] = router_of(zid, answer.sample.payload.to_bytes())
    for those in parameters(session, "*").values():
        found.parameters |= {(each.node, each.name): each for each in those}
    answered: dict[str, list[Presence]] = {}
    end_s = time.monotonic() + for_s
    while not session.stopping:
        found.nodes = present(session)
        found.history.note(found.nodes)
        for each in found.nodes:
            _keep_quickest(found.clocks, each)
            if each.description is not None:
                answered.setdefault(each.name, []).append(each)
        if time.monotonic() >= end_s:
            break
        session.wait(LOOK_S)
    found.reached = tuple(map(str, session.link.session.info.routers_zid()))
    # One that answered before is busy at the most.
    found.nodes = [
        answered[each.name][-1] if each.description is None and each.name in answered else each
        for each in found.nodes
    ]
    return found


def router_of(zid: str, payload: bytes) -> Router:
    """Return what a router's answer says; what it does not say in a known form is left out."""
    try:
        said: dict[str, Any] = json.loads(payload)
        version = str(said.get("version", "")).lstrip("v").partition("-")[0].partition(" ")[0]
        sharing = [s["peer"] for s in said.get("sessions") or () if s.get("shm") is True]
    except (ValueError, KeyError, TypeError, AttributeError):
        return Router(zid, None, ())
    return Router(zid, version or None, tuple(map(str, sharing)))


def _keep_quickest(clocks: dict[tuple[str, str | None], Clock], presence: Presence) -> None:
    known = clocks.get((presence.name, presence.session))
    clock = presence.clock
    if clock is not None and (known is None or clock.error_ns < known.error_ns):
        clocks[presence.name, presence.session] = clock
