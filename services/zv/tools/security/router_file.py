"""Makes the configuration of a router: certificates required, denied by default, and limits."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import Any, Final

from zenoh_vision import keys
from zenoh_vision.message_codec import MAX_MESSAGE_BYTES as LARGEST_MESSAGE
from zenoh_vision.security.rights import EVERYTHING, TO_ROUTER, Action, Rights, rule
from zenoh_vision.topics import TOPICS
from zenoh_vision.transport.declarations import Kind
from zenoh_vision.transport.zenoh_config import (
    MAX_MESSAGE_BYTES,
    MESSAGE_BATCHES,
    WAIT_BEFORE_CLOSE_US,
)
from zv.tools.security.authority import Issued, base64_of
from zv.tools.security.roles import router_keys, within

SEND_BUFFER: Final = 65536
"""Bytes. Frames grow old in a larger one. With 32768, as in configs/router.json5, TLS stops for
40 ms at large frames: it fills that with too little for Linux to acknowledge it at once."""

MUTUAL: Final = {
    "enable_mtls": True,
    "verify_name_on_connect": True,
    "close_link_on_expiration": True,
}
"""How each side checks the other one's certificate."""

QUERY_BYTES: Final = 1 << 16
"""Largest payload of a query: a node refuses more."""

CONTROL_BYTES: Final = 1 << 20
"""Largest payload about a node, such as the list of its parameters."""

REPORTS_HZ: Final = 20.0
CHANGES_HZ: Final = 200.0
"""Most reports and changes of parameters that a router takes from one session. Zenoh limits by the
interval, so that of two that follow each other closely one is dropped: the limits are far above
what is usual, and streams have none."""

SESSIONS_PER_HOLDER: Final = 4
MIN_SESSIONS: Final = 64


def router_file(
    namespace: str,
    router: Issued,
    authority: Issued,
    *,
    listen: str,
    connect: tuple[str, ...],
    holders: Mapping[str, tuple[str, Rights]],
    routers: tuple[str, ...],
    nodes: Iterable[str],
) -> dict[str, Any]:
    """Return a router's configuration in Zenoh's format.

    Args:
        namespace: First chunk of the keys.
        router: Its certificate and key.
        authority: Whose certificates it accepts.
        listen: Endpoint.
        connect: Endpoints of other routers.
        holders: A holder's name and rights, by the common name of its certificate.
        routers: The common names of the system's routers.
        nodes: The names of its nodes.
    """
    tls = {
        "root_ca_certificate_base64": base64_of(authority.certificate),
        "listen_certificate_base64": base64_of(router.certificate),
        "listen_private_key_base64": base64_of(router.key),
        "connect_certificate_base64": base64_of(router.certificate),
        "connect_private_key_base64": base64_of(router.key),
        **MUTUAL,
    }
    block = {"block": {"wait_before_close": WAIT_BEFORE_CLOSE_US}}
    size = {"data": 1, "data_low": 1, "interactive_high": MESSAGE_BATCHES}
    sessions = max(MIN_SESSIONS, SESSIONS_PER_HOLDER * (len(holders) + len(routers)))
    return {
        "mode": "router",
        "listen": {"endpoints": [listen]},
        "connect": {"endpoints": list(connect)},
        "scouting": {"multicast": {"enabled": False}, "gossip": {"enabled": False}},
        "adminspace": {"enabled": True, "permissions": {"read": True, "write": False}},
        "transport": {
            "shared_memory": {"enabled": False},
            "unicast": {"max_sessions": sessions},
            "link": {
                # Only what authenticates itself is spoken to.
                "protocols": ["tls"],
                "tls": tls,
                "rx": {"max_message_size": MAX_MESSAGE_BYTES},
                "tx": {"queue": {"size": size, "congestion_control": block}},
            },
        },
        "access_control": access_control(namespace, holders, routers),
        "low_pass_filter": _size_limits(namespace),
        "downsampling": _rate_limits(namespace, nodes),
    }


def access_control(
    namespace: str, holders: Mapping[str, tuple[str, Rights]], routers: tuple[str, ...]
) -> dict[str, Any]:
    """Return Zenoh's table of access rules: a subject, its rules and a policy for each holder."""
    rules, subjects, policies = [], [], []
    for name, (holder, rights) in holders.items():
        own = rights.rules(name, (*within(namespace), keys.holder_key("*")))
        shown = [keys.granted_key(holder, "*", *each) for each in _declarable(rights)]
        own.append(rule(f"{name}: granted", "ingress", TO_ROUTER["announce"], shown))
        rules += own
        subjects.append({"id": name, "cert_common_names": [name]})
        policies.append({"subjects": [name], "rules": [each["id"] for each in own]})
    between = router_keys(namespace)
    passed = [rule(f"routers: {flow}", flow, EVERYTHING, between) for flow in ("ingress", "egress")]
    subjects.append({"id": "routers", "cert_common_names": list(routers)})
    policies.append({"subjects": ["routers"], "rules": [each["id"] for each in passed]})
    return {
        "enabled": True,
        "default_permission": "deny",
        "rules": [*rules, *passed],
        "subjects": subjects,
        "policies": policies,
    }


def _declarable(rights: Rights) -> Iterator[tuple[Kind, str]]:
    """Yield the kind and key of each declaration that a holder's tokens may show."""
    kinds: dict[Action, Kind] = {"answer": "queryable", "subscribe": "subscriber"}
    for action, kind in kinds.items():
        for key in rights.allowed.get(action, ()):
            if not key.startswith("@"):
                yield kind, key


def _size_limits(namespace: str) -> list[dict[str, Any]]:
    data, control = within(namespace)
    messages = [topic.key(namespace, "*") for topic in TOPICS.values() if topic.message]

    def limit(name: str, kinds: list[str], key_exprs: list[str], size: int) -> dict[str, Any]:
        return {
            "id": name,
            "flows": ["ingress"],
            "messages": kinds,
            "key_exprs": key_exprs,
            "size_limit": size,
        }

    return [
        limit("queries", ["query"], [data, control], QUERY_BYTES),
        limit("about nodes", ["put", "reply"], [control], CONTROL_BYTES),
        limit("messages", ["put", "reply"], messages, LARGEST_MESSAGE),
    ]


def _rate_limits(namespace: str, nodes: Iterable[str]) -> list[dict[str, Any]]:
    def limit(name: str, kind: str, expressions: list[str], rate_hz: float) -> dict[str, Any]:
        # One rule for each node: those of one rule are limited together.
        rules = [{"key_expr": key, "freq": rate_hz} for key in expressions]
        return {"id": name, "flows": ["ingress"], "messages": [kind], "rules": rules}

    reports = [keys.diagnostics_key(namespace, node) for node in nodes]
    changes = [f"{keys.set_key(namespace, node)}/**" for node in nodes]
    return [
        limit("reports", "put", reports, REPORTS_HZ),
        limit("changes", "query", changes, CHANGES_HZ),
    ]
