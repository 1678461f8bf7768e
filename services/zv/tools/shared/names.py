"""Names in the running system, for completion: keys, nodes, parameters and their values.

A shell waits for this, so it loads no models: unexpected parts of a reply are left out. Without a
router there are no names.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator
from dataclasses import replace
from threading import Thread
from typing import Any

import msgpack
import zenoh

from zenoh_vision import keys
from zenoh_vision.errors import VisionError
from zenoh_vision.transport.connection import DEFAULT_ENDPOINT, Connection
from zenoh_vision.transport.declarations import declared_expression, declared_key
from zenoh_vision.transport.session import open_session

OPEN_S = 0.1
REPLY_S = 0.1
"""Time limits for a router and for nodes that do not answer; others take some milliseconds."""

MAX_BYTES = 256 << 10
MAX_NAMES = 1000
MAX_CHARACTERS = 200


def connection_of(flags: dict[str, str]) -> Connection:
    """Return the connection that flags and the environment name, without checking it."""

    def given(flag: str, variable: str) -> str | None:
        return flags.get(flag) or os.environ.get(variable) or None

    return Connection(
        connect=given("--connect", "ZV_CONNECT") or DEFAULT_ENDPOINT,
        namespace=given("--namespace", "ZV_NAMESPACE") or keys.DEFAULT_NAMESPACE,
        zenoh_config=given("--zenoh-config", "ZV_ZENOH_CONFIG"),
    )


def names(kind: str, connection: Connection, node: str = "", parameter: str = "") -> list[str]:
    """Return the names of a kind in the running system, sorted; none if there is no router.

    Args:
        kind: ``key``, ``node``, ``parameter`` of a node, or ``value`` of its parameter.
        connection: Where the router is.
        node: The node of the parameters.
        parameter: The parameter of the values.
    """
    for text in (connection.namespace, *([node] if kind in ("parameter", "value") else [])):
        if not keys.is_name(text):
            return []
    try:
        session = open_session(replace(connection, timeout_s=OPEN_S))
    except VisionError:
        return []
    try:
        found = set(_names(session, kind, connection, node, parameter))
    finally:
        Thread(target=session.close, daemon=True).start()  # a shell does not wait for that
    return sorted(filter(_may_be_typed, found))[:MAX_NAMES]


def _names(
    session: zenoh.Session, kind: str, connection: Connection, node: str, parameter: str
) -> Iterator[str]:
    if kind == "key":
        yield from _keys(session, connection.namespace)
    elif kind == "node":
        replies = session.liveliness().get(
            keys.node_key(connection.namespace, "*"), timeout=REPLY_S
        )
        yield from (str(each.ok.key_expr).rpartition("/")[2] for each in replies if each.ok)
    else:
        yield from _parameters(session, connection.namespace, node, parameter)


def _keys(session: zenoh.Session, namespace: str) -> Iterator[str]:
    """Yield the keys that nodes publish, and those that routers list for other programs."""
    described = session.get(
        keys.node_key(namespace, "*"), target=zenoh.QueryTarget.ALL, timeout=REPLY_S
    )
    declared = session.get(declared_key("publisher", "**"), timeout=REPLY_S)
    for about in _maps(described):
        listed = about.get("publishes")
        yield from (key for key in _listed(listed) if isinstance(key, str))
    for reply in declared:
        if reply.ok is not None:
            key = declared_expression(str(reply.ok.key_expr))
            if key and "*" not in key:
                yield key


def _parameters(session: zenoh.Session, namespace: str, node: str, parameter: str) -> Iterator[str]:
    """Yield the names of a node's parameters, or the values that one of them may have."""
    for about in _maps(session.get(keys.parameters_key(namespace, node), timeout=REPLY_S)):
        for each in _listed(about.get("parameters")):
            if not isinstance(each, dict) or not isinstance(each.get("name"), str):
                continue
            if not parameter:
                yield each["name"]
            elif each["name"] == parameter:
                yield from map(str, _listed(each.get("choices")))
                yield from ("true", "false") if each.get("type") == "bool" else ()


def _listed(value: object) -> list[Any]:
    return value if isinstance(value, list) else []


def _maps(replies: Iterable[zenoh.Reply]) -> Iterator[dict[str, Any]]:
    for reply in replies:
        if reply.ok is None or len(reply.ok.payload) > MAX_BYTES:
            continue
        try:
            value = msgpack.unpackb(reply.ok.payload.to_bytes())
        except (ValueError, msgpack.UnpackException):
            continue
        if isinstance(value, dict):
            yield value


def _may_be_typed(name: str) -> bool:
    """Tell whether a name is safe in a shell's line; anyone can announce names."""
    return bool(name) and len(name) <= MAX_CHARACTERS and all(map(_plain, name))


def _plain(character: str) -> bool:
    return character.isascii() and (character.isalnum() or character in "_-./@")
