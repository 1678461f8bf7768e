"""States of nodes, made by hand; and what a fleet says of them."""

from __future__ import annotations

from typing import Any

from zenoh_vision.health.fleet import Fleet
from zenoh_vision.health.node_state import NodeState, S
from zenoh_vision.messages import Diagnostics, Latency, NodeDescription, Parameter

NOW_NS = 1_750_000_000 * S
FORGET_S = 300.0


def report(node: str = "tracker_front", **fields: Any) -> Diagnostics:
    return Diagnostics.model_validate(
        {
            "node": node,
            "stamp_ns": NOW_NS - S // 2,
            "level": 0,
            "message": "ok",
            "uptime_s": 60.0,
            "counters": {"received": 100, "processed": 100, "pending": 0},
            "rate_hz": 30.0,
            "latency_ms": Latency(p50=5.0, p99=9.0),
            **fields,
        }
    )


def description(node: str = "tracker_front", **fields: Any) -> NodeDescription:
    return NodeDescription.model_validate(
        {
            "node": node,
            "service": "tracker",
            "cameras": ("front",),
            "version": "0.1.0",
            "host": "roof",
            "pid": 77,
            "started_ns": NOW_NS - 60 * S,
            "publishes": (),
            "subscribes": (),
            "stamp_ns": NOW_NS,
            **fields,
        }
    )


def node_state(
    name: str = "tracker_front",
    session: str = "a1",
    health: Diagnostics | None = None,
    **about: Any,
) -> NodeState:
    return NodeState(
        name,
        session,
        has_token=True,
        answered=True,
        description=description(name, **about),
        reports=(health or report(),),
    )


def parameter(node: str, value: float | str, revision: int, name: str = "low") -> Parameter:
    return Parameter(
        node=node, name=name, type="float", value=value, default=4.0, revision=revision
    )


def alive(fleet: Fleet, at_s: float) -> dict[str, bool]:
    fleet.expire(int(at_s * S))
    return {node.name: node.alive for node in fleet.nodes()}


def only(fleet: Fleet) -> NodeState:
    (node,) = fleet.nodes()
    return node
