"""Observes the routers, and the nodes over a few seconds, for ``zv doctor``."""

from __future__ import annotations

import json
import time
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, cast

from zenoh_vision.health.fleet import Fleet
from zenoh_vision.health.node_state import NodeState
from zenoh_vision.keys import camera_of, suffix_of
from zenoh_vision.messages import Parameter
from zenoh_vision.topics import COMPRESSED, RAW
from zenoh_vision.transport.declarations import ROUTERS
from zv.tools.doctor.other_cameras import ArrivalCounter, OtherCamera
from zv.tools.shared.discovery import Discovery, discover
from zv.tools.shared.nodes import parameters_by_session, running_nodes
from zv.tools.shared.session import ToolSession

PERIOD_S = 0.5
MAX_SESSIONS = 2000
MAX_ADDRESS = 100


@dataclass(frozen=True, slots=True)
class Router:
    """The state of a router by its admin space.

    Attributes:
        version: Version of Zenoh, ``1.10.2``; None if it is in another form.
        sharing: Zenoh ids of the sessions that it shares memory with.
        addresses: Where its sessions connect from, by Zenoh id.
    """

    zid: str
    version: str | None
    sharing: tuple[str, ...]
    addresses: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class Observation:
    """Everything that was observed.

    Attributes:
        routers: The routers whose admin space answered, by id.
        reached: Ids of the routers that this tool is connected to at the end.
        nodes: The nodes at the end, with all their diagnostics.
        left_out: How many more nodes there are, none of which answers.
        others: The cameras that are not nodes.
        others_left_out: How many more of them there are.
        discovery: What the nodes say at the end, and what was declared at the beginning.
        own: Id of this tool's session.
        parameters: Parameters by node and name; empty if no node answers for its parameters.
    """

    routers: dict[str, Router]
    reached: tuple[str, ...]
    nodes: list[NodeState]
    parameters: dict[tuple[str, str], Parameter]
    discovery: Discovery
    left_out: int = 0
    others: tuple[OtherCamera, ...] = ()
    others_left_out: int = 0
    own: str = ""

    def value(self, node: str, parameter: str) -> float | None:
        """Return the value of a numeric parameter; None if it is unknown or not a number."""
        known = self.parameters.get((node, parameter))
        if known is not None and type(known.value) in (int, float):
            return cast("float", known.value)
        if parameter == "rate":
            described = (n.description for n in self.nodes if n.name == node and n.description)
            return next((each.rate_hz for each in described if each.rate_hz), None)
        return None

    def is_published(self, key: str) -> bool:
        """Tell whether a node publishes a key, or any other program has declared that it does."""
        others = any(each.key == key for each in self.others)
        return bool(others or self.discovery.nodes_publishing(key) or self.strangers(key)[1])

    def strangers(self, key: str) -> tuple[list[str], bool]:
        """Return the programs, except nodes, that may send on a key, and whether that is certain.

        It is certain for those that declared a publisher; a program can send without one. Zenoh
        does not tell from which session a sample came.
        """
        known = {each.session for each in self.nodes} | {self.own}
        connected = {zid for router in self.routers.values() for zid in router.addresses}
        found = self.discovery.sessions_publishing(key) - known
        return sorted(map(self._session, found or connected - known)), bool(found)

    def _session(self, zid: str) -> str:
        addresses = (router.addresses.get(zid) for router in self.routers.values())
        address = next(filter(None, addresses), None)
        return f"session {zid}" + (f" from {address}" if address else "")

    def cameras(self) -> list[NodeState]:
        """Return the nodes that are cameras."""
        return [n for n in self.nodes if n.description and n.description.service == "camera"]


def other_form(key: str) -> str:
    """Return the key of the same frames in the other form, compressed or raw; empty if none."""
    names = {COMPRESSED.name: RAW.name, RAW.name: COMPRESSED.name}
    namespace, _, _ = key.partition("/")
    other = names.get(suffix_of(key))
    return f"{namespace}/{camera_of(key)}/{other}" if other else ""


def observe(session: ToolSession, for_s: float) -> Observation:
    """Observe nodes and cameras for a time, and query the routers and the parameters.

    The time begins with the first replies of the nodes: where thousands of names are in use, these
    can take longer than ``for_s``, and a node is judged by two reports.
    """
    routers = [
        router_of(reply.key.split("/")[1], reply.ok.payload.to_bytes())
        for reply in session.ask(ROUTERS)
        if reply.ok
    ]
    declared = discover(session)
    known = parameters_by_session(session, "*").values()
    arrivals = ArrivalCounter(session, declared)
    fleet = Fleet(window_s=float("inf"))
    end_s: float | None = None
    left_out = 0
    while not session.stopping:
        found, left_out = running_nodes(session)
        fleet.update(found)
        now_s = time.monotonic()
        end_s = end_s or now_s + for_s
        if now_s >= end_s:
            break
        session.wait(PERIOD_S)
        arrivals.update()
    return Observation(
        routers={router.zid: router for router in routers},
        reached=tuple(map(str, session.link.session.info.routers_zid())),
        nodes=fleet.nodes(),
        left_out=left_out,
        others=arrivals.close(),
        others_left_out=arrivals.left_out,
        discovery=replace(
            declared, nodes=tuple(n.description for n in fleet.nodes() if n.description)
        ),
        own=str(session.link.session.zid()),
        parameters={(each.node, each.name): each for those in known for each in those},
    )


def router_of(zid: str, payload: bytes) -> Router:
    """Return the state of a router from its reply, without fields of unknown form."""
    try:
        said: dict[str, Any] = json.loads(payload)
        version = str(said.get("version", "")).lstrip("v").partition("-")[0].partition(" ")[0]
        sessions = list(said.get("sessions") or ())[:MAX_SESSIONS]
        sharing = [s["peer"] for s in sessions if s.get("shm") is True]
        addresses = {
            str(s["peer"]): str(link["dst"])[:MAX_ADDRESS]
            for s in sessions
            for link in (s.get("links") or ())[:1]
        }
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError):
        return Router(zid, None, ())
    return Router(zid, version or None, tuple(map(str, sharing)), addresses)
