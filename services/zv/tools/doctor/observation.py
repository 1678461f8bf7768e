"""Observes the routers, and the nodes over a few seconds, for ``zv doctor``."""

from __future__ import annotations

import json
import time
from dataclasses import dataclass
from typing import Any, cast

from zenoh_vision.health.fleet import Fleet
from zenoh_vision.health.node_state import NodeState
from zenoh_vision.messages import Parameter
from zv.tools.shared.nodes import parameters_by_session, running_nodes
from zv.tools.shared.session import ROUTERS, ToolSession

PERIOD_S = 0.5


@dataclass(frozen=True, slots=True)
class Router:
    """The state of a router by its admin space.

    Attributes:
        version: Version of Zenoh, ``1.10.2``; None if it is in another form.
        sharing: Zenoh ids of the sessions that it shares memory with.
    """

    zid: str
    version: str | None
    sharing: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Observation:
    """Everything that was observed.

    Attributes:
        routers: The routers whose admin space answered, by id.
        reached: Ids of the routers that this tool is connected to at the end.
        nodes: The nodes at the end, with all their diagnostics.
        left_out: How many more nodes there are, none of which answers.
        parameters: Parameters by node and name; empty if no node answers for its parameters.
    """

    routers: dict[str, Router]
    reached: tuple[str, ...]
    nodes: list[NodeState]
    parameters: dict[tuple[str, str], Parameter]
    left_out: int = 0

    def value(self, node: str, parameter: str) -> float | None:
        """Return the value of a numeric parameter; None if it is unknown or not a number."""
        known = self.parameters.get((node, parameter))
        if known is not None and type(known.value) in (int, float):
            return cast("float", known.value)
        if parameter == "rate":
            described = (n.description for n in self.nodes if n.name == node and n.description)
            return next((each.rate_hz for each in described if each.rate_hz), None)
        return None

    def publishers_of(self, key: str) -> list[str]:
        """Return the names of the nodes that publish a key."""
        publishing = (n for n in self.nodes if n.description and key in n.description.publishes)
        return sorted({node.name for node in publishing})

    def cameras(self) -> list[NodeState]:
        """Return the nodes that are cameras."""
        return [n for n in self.nodes if n.description and n.description.service == "camera"]


def observe(session: ToolSession, for_s: float) -> Observation:
    """Observe the nodes for a time, and query the routers and the parameters."""
    routers = [
        router_of(reply.key.split("/")[1], reply.ok.payload.to_bytes())
        for reply in session.ask(ROUTERS)
        if reply.ok
    ]
    known = parameters_by_session(session, "*").values()
    fleet = Fleet(window_s=float("inf"))
    end_s, left_out = time.monotonic() + for_s, 0
    while not session.stopping:
        found, left_out = running_nodes(session)
        fleet.update(found)
        if time.monotonic() >= end_s:
            break
        session.wait(PERIOD_S)
    return Observation(
        routers={router.zid: router for router in routers},
        reached=tuple(map(str, session.link.session.info.routers_zid())),
        nodes=fleet.nodes(),
        left_out=left_out,
        parameters={(each.node, each.name): each for those in known for each in those},
    )


def router_of(zid: str, payload: bytes) -> Router:
    """Return the state of a router from its reply, without fields of unknown form."""
    try:
        said: dict[str, Any] = json.loads(payload)
        version = str(said.get("version", "")).lstrip("v").partition("-")[0].partition(" ")[0]
        sharing = [s["peer"] for s in said.get("sessions") or () if s.get("shm") is True]
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError):
        return Router(zid, None, ())
    return Router(zid, version or None, tuple(map(str, sharing)))
