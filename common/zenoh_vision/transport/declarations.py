"""Finds out who publishes, subscribes and answers queries, from the routers' admin spaces.

A router lists every publisher, subscriber and queryable that is declared, by a node or not.
Querying that list does not start streams that are produced on demand, as a subscription would.
Programs that put samples without declaring a publisher are not in it.

Completion uses this while a shell waits, so it imports no models.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Final, Literal

if TYPE_CHECKING:
    from zenoh_vision.transport.query import Reply

ROUTERS: Final = "@/*/router"
"""Keys of the routers' admin spaces, where those are enabled."""

MAX_BYTES: Final = 1 << 20
"""Limit of the list of one key's sessions: each takes some 40 bytes."""

MAX_ID: Final = 32
"""Characters of a session's id, in hexadecimal."""

Kind = Literal["publisher", "subscriber", "queryable"]
Sessions = Mapping[str, frozenset[str]]
"""Ids of the sessions that declared something, by key expression."""


def declared_key(kind: Kind, pattern: str) -> str:
    """Return the key expression to query for what is declared on a key expression."""
    return f"{ROUTERS}/{kind}/{pattern}"


def declared_expression(key: str) -> str:
    """Return the key expression that was declared, by the key of a reply to such a query.

    Empty for a key of another form.
    """
    chunks = key.split("/", 4)  # @/{router}/router/{kind}/{key expression}
    return chunks[4] if len(chunks) == 5 else ""


def sessions_in(replies: Iterable[Reply], own: str) -> Sessions:
    """Return who declared what, by the replies to such a query, without one's own session.

    Args:
        replies: Of the routers.
        own: Id of one's own session.
    """
    found: dict[str, frozenset[str]] = {}
    for reply in replies:
        key, sessions = declaration_in(reply)
        if key and (others := sessions - {own}):
            found[key] = found.get(key, frozenset()) | others
    return found


def session_ids(replies: Iterable[Reply]) -> frozenset[str]:
    """Return the ids of all sessions of the routers that replied to a query for ``ROUTERS``."""
    found: set[str] = set()
    for reply in replies:
        if reply.ok is None or len(reply.ok.payload) > MAX_BYTES:
            continue
        try:
            sessions = json.loads(reply.ok.payload.to_bytes())["sessions"]
            found.update(str(session["peer"])[:MAX_ID] for session in sessions)
        except (ValueError, KeyError, TypeError, RecursionError):
            continue  # a router of an unknown version
    return frozenset(found)


def declaration_in(reply: Reply) -> tuple[str, frozenset[str]]:
    """Return a key expression, and the ids of the sessions that declared something on it.

    There are none in a reply that is not a router's, or of a router of an unknown version.
    """
    key = declared_expression(reply.key)
    if reply.ok is None or len(reply.ok.payload) > MAX_BYTES:
        return key, frozenset()
    try:
        sources = json.loads(reply.ok.payload.to_bytes())
        clients, peers = sources["clients"], sources["peers"]
    except (ValueError, KeyError, TypeError, RecursionError):
        return key, frozenset()
    if not isinstance(clients, list) or not isinstance(peers, list):
        return key, frozenset()
    ids = [*clients, *peers]
    known = all(isinstance(each, str) and len(each) <= MAX_ID for each in ids)
    return key, frozenset(ids) if known else frozenset()
