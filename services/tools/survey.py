"""What there is on the network, without touching it: nodes, keys, who publishes and subscribes.

Nodes say what they publish. The router's admin space knows every declared publisher and
subscriber, others' too. Neither makes a stream flow that is made on demand only, as a
subscription would.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import zenoh

from common.keys import node_key
from common.messages import NodeDescription
from services.tools.asking import Answer
from services.tools.nearest import nothing_matches
from services.tools.nodes import every_answer_on, read
from services.tools.session import ROUTERS, ToolSession

KINDS = ("publisher", "subscriber")

Sessions = Mapping[str, frozenset[str]]
"""Ids of the sessions that declared something, by key expression."""


@dataclass(frozen=True, slots=True)
class Survey:
    """What nodes and router say at one moment; our own session is left out.

    Attributes:
        nodes: Descriptions of the nodes that answered.
        publishers: Sessions by the key expression that they declared to publish.
        subscribers: Sessions by the key expression that they subscribe to.
        answered: Whether the router lets one look; else it is unknown who subscribes.
    """

    nodes: tuple[NodeDescription, ...]
    publishers: Sessions
    subscribers: Sessions
    answered: bool

    def keys(self, pattern: str | None = None) -> set[str]:
        """Return the keys that someone says to publish, those that a pattern matches."""
        said = {key for node in self.nodes for key in node.publishes}
        found = {key for key in said.union(self.publishers) if "*" not in key}
        return found if pattern is None else {key for key in found if _meet(pattern, key)}

    def nodes_publishing(self, key: str) -> list[str]:
        """Return the names of the nodes that say they publish a key."""
        return sorted(node.node for node in self.nodes if key in node.publishes)

    def nodes_subscribing(self, key: str) -> list[str]:
        """Return the names of the nodes that say they subscribe to a key."""
        return sorted(
            node.node for node in self.nodes if any(_meet(each, key) for each in node.subscribes)
        )

    def publisher_count(self, key: str) -> int:
        """Return how many publish a key as far as is known."""
        return max(len(self.nodes_publishing(key)), len(_at(self.publishers, key)))

    def subscriber_count(self, key: str) -> int | None:
        """Return how many sessions besides ours subscribe to a key; None if that is unknown."""
        return len(_at(self.subscribers, key)) if self.answered else None

    def nothing_on(self, pattern: str) -> str:
        """Return what to say when nothing came on a key expression."""
        silent = sorted(self.keys(pattern))
        if not silent:
            return nothing_matches(pattern, self.keys())
        publishers = {name for key in silent for name in self.nodes_publishing(key)}
        by = ", ".join(sorted(publishers)) or "a publisher"
        return f"nothing came on {pattern}, though {by} is there to publish {', '.join(silent)}"


def survey(session: ToolSession) -> Survey:
    """Ask nodes and router what there is."""
    selectors = [
        f"{ROUTERS}/{kind}/{rest}" for kind in KINDS for rest in ("**", f"@{session.namespace}/**")
    ]
    asked = [node_key(session.namespace, "*"), ROUTERS, *selectors]
    described, admin, *declared = session.gather(*(every_answer_on(session, key) for key in asked))
    own = str(session.link.session.zid())
    found = {
        kind: _sessions(declared[2 * index] + declared[2 * index + 1], kind, own)
        for index, kind in enumerate(KINDS)
    }
    return Survey(
        nodes=tuple(node for _, node in read(described, NodeDescription)),
        publishers=found["publisher"],
        subscribers=found["subscriber"],
        answered=bool(admin),
    )


def _sessions(answers: Iterable[Answer], kind: str, own: str) -> Sessions:
    found: dict[str, set[str]] = {}
    for answer in answers:
        key = str(answer.sample.key_expr).partition(f"/router/{kind}/")[2]
        try:
            sources = json.loads(answer.sample.payload.to_bytes())
            ids = {*sources["clients"], *sources["peers"]} - {own}
        except (ValueError, KeyError, TypeError):
            continue  # a router of another version
        if key and ids:
            found.setdefault(key, set()).update(ids)
    return {key: frozenset(ids) for key, ids in found.items()}


def _at(sessions: Sessions, key: str) -> set[str]:
    return {each for declared, ids in sessions.items() if _meet(declared, key) for each in ids}


def _meet(pattern: str, key: str) -> bool:
    try:
        return zenoh.KeyExpr(pattern).intersects(zenoh.KeyExpr(key))
    except zenoh.ZError:
        return False  # a node may say what it likes
