"""Checks of certificates and rights: one's own, the router's, and what it denies others."""

from __future__ import annotations

import time
from collections.abc import Iterable, Iterator

from zenoh_vision import keys
from zenoh_vision.error_text import joined
from zenoh_vision.security.credentials import (
    DAY_S,
    WARN_S,
    Credentials,
    renewal,
    shown_time,
)
from zenoh_vision.transport.declarations import ROUTERS, declared_key, session_ids, sessions_in
from zenoh_vision.transport.handshake import router_certificate_ends_s
from zenoh_vision.transport.query import Query, Reply
from zenoh_vision.transport.zenoh_config import client_config, connect_endpoints
from zv.tools.doctor.finding import Finding, or_ok
from zv.tools.doctor.observation import Observation
from zv.tools.shared.session import ToolSession

MOST_SHOWN = 4
LISTED_BYTES = 8 << 20
MOST_SAID = 1000


def certificate_findings(session: ToolSession, credentials: Credentials) -> Iterator[Finding]:
    """Check when one's own certificate ends, and when the router's does."""
    validity = credentials.validity
    own = validity.fault() or validity.warning()
    if own:
        said, _, remedy = own.rpartition(": ")
        yield Finding("WARN", "validity", said, remedy)
    endpoints = connect_endpoints(client_config(session.connection))
    ends_s = router_certificate_ends_s(endpoints, credentials)
    if ends_s is not None:
        left_days = (ends_s - time.time()) / DAY_S
        if left_days * DAY_S < WARN_S:
            said = f"the router's certificate ends {shown_time(ends_s)}, in {left_days:.0f} days"
            yield Finding("WARN", "validity", said, renewal(credentials.path.parent, "router"))
            return
    if not own:
        until = min(filter(None, (validity.ends_s, ends_s)))
        said = f"the certificate of {credentials.name} is valid until {shown_time(until)}"
        yield Finding("OK", "validity", said)


def access_findings(
    session: ToolSession, credentials: Credentials, seen: Observation
) -> list[Finding]:
    """Find connected sessions to which a router denies what they declare, or everything.

    The credentials of a node do not allow to ask for that: the finding says that it is unknown.
    """
    data = f"{session.namespace}/**"
    asked = (
        keys.holder_key("*"),
        ROUTERS,
        declared_key("queryable", keys.holder_key("*")),
        declared_key("queryable", data),
        declared_key("subscriber", data),
    )
    answers, routers, *listed = session.ask_all(
        *(Query(key, most_bytes=LISTED_BYTES) for key in asked)
    )
    own = str(session.link.session.zid())
    folder = credentials.path.parent
    problems = list(_denied(answers))
    known = frozenset().union(
        *(zids for each in listed for zids in sessions_in(each, own).values())
    )
    strangers = session_ids(routers) - known - {own} - seen.routers.keys()
    if strangers:
        where = (
            address
            for router in seen.routers.values()
            for zid, address in router.addresses.items()
            if zid in strangers
        )
        count = len(strangers)
        said = f"{count} session{'s' if count > 1 else ''} without any right: " + (
            joined(sorted(where), MOST_SHOWN) or "of unknown address"
        )
        remedy = f"their certificates were revoked, or unknown: zv security show --dir {folder}"
        problems.append(Finding("WARN", "access", said, remedy))
    unknown = [key for key in asked if session.denial("query", key) is not None]
    if unknown and not problems:
        said = f"{credentials.name} may not query {joined(unknown, MOST_SHOWN)}"
        remedy = f"give the credentials of an operator or a guest, of {folder}"
        problems.append(Finding("WARN", "access", f"{said}: what is denied is unknown", remedy))
    return or_ok(problems, "access", "the router denies no session what it declares")


def _denied(answers: Iterable[Reply]) -> Iterator[Finding]:
    """Yield what nodes say that a router denies them, each once."""
    said = {
        (each.name, each.ok.payload.to_bytes()[:MOST_SAID].decode(errors="replace"))
        for each in answers
        if each.ok is not None
    }
    for name, text in sorted(said):
        what, _, remedy = text.partition("; ")
        yield Finding("FAIL", "access", f"{name}: {what}", remedy, (name,))
