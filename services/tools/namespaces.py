"""Which namespaces there are, for one who looks in the wrong one.

The keys of nodes begin with ``@`` and the namespace, and no wildcard matches such a chunk. So the
streams are looked for, whose keys begin with the namespace alone; then the nodes in each.
"""

from __future__ import annotations

from common import keys
from services.tools.nearest import nothing_matches
from services.tools.nodes import tokens_of
from services.tools.session import ROUTERS, ToolSession

QUERYABLES = f"{ROUTERS}/queryable"
"""A router's list of who answers on which key, where its admin space is on."""

ASKED = (keys.IMAGE, keys.CENTROID, keys.EDGES)
"""Asked for their newest where it is off: costs every camera a picture, so only then."""


def other_namespaces(session: ToolSession) -> dict[str, list[str]]:
    """Return the namespaces besides our own in which there are nodes, and the nodes' names."""
    suffixes = {topic.suffix for topic in keys.TOPICS.values()}
    streams = [
        str(reply.ok.key_expr).partition("/router/queryable/")[2]
        for reply in session.ask(f"{QUERYABLES}/**")
        if reply.ok
    ]
    if not streams:
        streams = [
            str(reply.ok.key_expr)
            for topic in ASKED
            for reply in session.ask(f"*/*/{topic.suffix}")
            if reply.ok
        ]
    chunks = [key.split("/", 2) for key in streams]
    found = {c[0] for c in chunks if len(c) == 3 and c[2] in suffixes and keys.is_name(c[0])}
    others = sorted(found - {session.namespace})
    answers = session.gather(*(tokens_of(session, namespace) for namespace in others))
    return {
        namespace: sorted(answer.name for answer in tokens)
        for namespace, tokens in zip(others, answers, strict=True)
        if tokens
    }


def nobody_here(session: ToolSession) -> str:
    """Return what to say when there is no node in the namespace: which others have some."""
    others = other_namespaces(session)
    if not others:
        return f"no node in namespace {session.namespace}; `zv up` starts a system"
    there_are = nothing_matches(session.namespace, others, kind="namespace").partition(": ")[2]
    return f"no node in namespace {session.namespace}: {there_are}"
