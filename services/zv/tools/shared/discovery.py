"""Discovers nodes, keys, publishers, subscribers and namespaces without affecting the system.

Nodes describe what they publish. The router's admin space lists every declared publisher and
subscriber, including those of other programs. Querying them does not start streams that are
produced on demand, as a subscription would.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property

from zenoh_vision import keys
from zenoh_vision.error_text import did_you_mean, joined, similar_names
from zenoh_vision.errors import PayloadError
from zenoh_vision.health.fleet import MAX_NODES
from zenoh_vision.health.message_limits import check
from zenoh_vision.messages import NodeDescription
from zenoh_vision.topics import CENTROID, COMPRESSED, EDGES, TOPICS, topic_of
from zenoh_vision.transport.declarations import (
    ROUTERS,
    Kind,
    Sessions,
    declared_expression,
    declared_key,
    sessions_in,
)
from zenoh_vision.transport.matching import SessionIndex, intersect
from zenoh_vision.transport.query import Query, messages_in
from zv.tools.shared.session import ToolSession

MOST_SHOWN = 12

TOKENS_S = 5.0
"""Time limit for a list of tokens. A router sends it at once, but thousands take time."""

MAX_KEYS = 2000
"""Most keys that are listed."""

MAX_NAMES = 2000
MAX_COMPARED = 200
"""Most names that are compared with a name, and their most characters, to limit the time."""


@dataclass(frozen=True)
class Discovery:
    """The replies of nodes and routers at one moment, without this tool's own session.

    Attributes:
        nodes: The nodes that answered.
        answered: Whether a router's admin space answered; if not, subscribers are unknown.
        refused: How many descriptions were refused as too large.
    """

    nodes: tuple[NodeDescription, ...]
    publishers: Sessions
    subscribers: Sessions
    answered: bool
    refused: int = 0

    def listed(self, pattern: str, seen: Iterable[str] = ()) -> tuple[list[str], int]:
        """Return the keys to list, at most ``MAX_KEYS``, and how many are left out.

        They are those that a pattern matches and those that were seen, known topics first.
        """
        found = sorted(self.keys(pattern).union(seen), key=lambda key: (topic_of(key) is None, key))
        return sorted(found[:MAX_KEYS]), max(0, len(found) - MAX_KEYS)

    def keys(self, pattern: str | None = None) -> set[str]:
        """Return the published keys, or those that match a pattern."""
        said = {key for node in self.nodes for key in node.publishes}
        found = {key for key in said.union(self.publishers) if "*" not in key}
        return found if pattern is None else {key for key in found if intersect(pattern, key)}

    def nodes_publishing(self, key: str) -> list[str]:
        """Return the names of the nodes whose description has a key among the published ones."""
        return self._publishing.get(key, [])

    def nodes_subscribing(self, key: str) -> list[str]:
        """Return the names of the nodes whose description has a key among the subscribed ones."""
        return sorted(
            node.node
            for node in self.nodes
            if any(intersect(each, key) for each in node.subscribes)
        )

    def sessions_publishing(self, key: str) -> set[str]:
        """Return the ids of the sessions that declared a publisher of a key."""
        return self._publisher_index.matching(key)

    def publisher_count(self, key: str) -> int:
        """Return the number of known publishers of a key."""
        return max(len(self.nodes_publishing(key)), len(self.sessions_publishing(key)))

    def others_publish(self, key: str) -> bool:
        """Tell whether a program that is not a node has declared a publisher of a key.

        Such a program does not wait for subscribers, so a subscription does not start its stream.
        """
        return self.publisher_count(key) > len(self.nodes_publishing(key))

    def subscriber_count(self, key: str) -> int | None:
        """Return the number of other sessions that subscribe to a key; None if it is unknown."""
        return len(self._subscriber_index.matching(key)) if self.answered else None

    @cached_property
    def _publishing(self) -> dict[str, list[str]]:
        found: dict[str, list[str]] = {}
        for node in sorted(self.nodes, key=lambda node: node.node):
            for key in dict.fromkeys(node.publishes):
                found.setdefault(key, []).append(node.node)
        return found

    @cached_property
    def _publisher_index(self) -> SessionIndex:
        return SessionIndex(self.publishers)

    @cached_property
    def _subscriber_index(self) -> SessionIndex:
        return SessionIndex(self.subscribers)

    def nothing_on(self, pattern: str, *, pictures: bool = False) -> str:
        """Return the error text for a key expression on which nothing arrived.

        With ``pictures`` it suggests no key that is known to carry messages.
        """
        silent = sorted(self.keys(pattern))
        if not silent:
            existing = self.keys()
            if pictures:
                existing = {key for key in existing if not _carries_messages(key)}
            return nothing_matches(pattern, existing)
        publishers = {name for key in silent for name in self.nodes_publishing(key)}
        by = ", ".join(sorted(publishers)) or "a publisher"
        shown = joined(silent, MOST_SHOWN)
        return f"nothing arrived on {pattern}, although {by} publishes {shown}"


def waiting_for(silence: str) -> str:
    """Return the note of a tool that keeps waiting on keys on which nothing arrived."""
    mark = "" if silence.endswith("?") else ";"
    return f"{silence}{mark} waiting for it (Ctrl-C ends it, --for 5s limits it)"


def discover(session: ToolSession) -> Discovery:
    """Query all nodes and routers."""
    asked = [keys.node_key(session.namespace, "*"), ROUTERS]
    kinds: tuple[Kind, ...] = ("publisher", "subscriber")
    for kind in kinds:  # no wildcard matches a chunk that begins with @
        asked += [declared_key(kind, each) for each in ("**", f"@{session.namespace}/**")]
    described, admin, *declared = session.ask_all(*map(Query, asked))
    own = str(session.link.session.zid())
    nodes, refused = [], 0
    for reply, node in messages_in(described, NodeDescription):
        try:
            check(reply.name, node)
            nodes.append(node)
        except PayloadError:
            refused += 1
    return Discovery(
        nodes=tuple(nodes[:MAX_NODES]),
        publishers=sessions_in(declared[0] + declared[1], own),
        subscribers=sessions_in(declared[2] + declared[3], own),
        answered=any(reply.ok for reply in admin),
        refused=refused + max(0, len(nodes) - MAX_NODES),
    )


def nothing_matches(wanted: str, existing: Iterable[str], *, kind: str = "key") -> str:
    """Return the error text, with what exists, for a name or key expression that matches nothing.

    ``kind`` is what they name, in the singular.
    """
    known = sorted({name for name in existing if len(name) <= MAX_COMPARED})
    if not known:
        return f"nothing matches {wanted}: there is no {kind} at all; is a node running?"
    compared = known[:MAX_NAMES]
    hint = did_you_mean(similar_names(wanted, compared), after=" ")
    shown = similar_names(wanted, compared, limit=MOST_SHOWN, similarity=0.0)
    more = f" and {len(known) - len(shown)} more" if len(known) > len(shown) else ""
    return f"nothing matches {wanted}: {hint}these exist: {', '.join(sorted(shown))}{more}"


def other_namespaces(session: ToolSession) -> dict[str, list[str]]:
    """Return the other namespaces that have nodes, with the names of their nodes.

    The keys of nodes begin with ``@`` and the namespace, and no wildcard matches such a chunk. So
    this first finds streams, whose keys begin with the namespace, then the nodes of each namespace.
    """
    listed = session.ask(declared_key("queryable", "**"))
    streams = [declared_expression(reply.key) for reply in listed if reply.ok]
    if not streams:  # no admin space; querying the nodes makes every camera encode a picture
        topics = (COMPRESSED, CENTROID, EDGES)
        asked = session.ask_all(*(Query(topic.key("*", "*")) for topic in topics))
        streams = [reply.key for replies in asked for reply in replies]
    suffixes = {topic.name for topic in TOPICS.values()}
    chunks = [key.split("/", 2) for key in streams]
    found = {c[0] for c in chunks if len(c) == 3 and c[2] in suffixes and keys.is_name(c[0])}
    others = sorted(found - {session.namespace})
    tokens = session.ask_all(*(tokens_query(namespace) for namespace in others))
    return {
        namespace: sorted(token.name for token in those)
        for namespace, those in zip(others, tokens, strict=True)
        if those
    }


def no_nodes(session: ToolSession) -> str:
    """Return the error text for a namespace without nodes, with the namespaces that have nodes."""
    others = other_namespaces(session)
    if not others:
        return f"no node in namespace {session.namespace}; `zv up` starts a system"
    existing = nothing_matches(session.namespace, others, kind="namespace").partition(": ")[2]
    return f"no node in namespace {session.namespace}: {existing}"


def tokens_query(namespace: str) -> Query:
    """Return the query for the liveliness tokens of a namespace's nodes."""
    return Query(keys.node_key(namespace, "*"), timeout_s=TOKENS_S, tokens=True)


def _carries_messages(key: str) -> bool:
    topic = topic_of(key)
    return topic is not None and topic.message is not None
