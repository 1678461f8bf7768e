"""How often a node asks its router what it has accepted, since each answer may lock it up."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from zenoh_vision.security.credentials import Credentials
from zenoh_vision.security.rights import Rights
from zenoh_vision.transport import access
from zenoh_vision.transport.declarations import declared_expression
from zenoh_vision.transport.query import Query, Replies, Reply

OWN, KEY, TOKEN = "ab", "vision/front/edges/contours", "@vision/node/edge_front"
RIGHTS = Rights.of([("publish", (KEY,)), ("announce", (TOKEN,))])
FILE = Path("security", "edge_front.json5")
CREDENTIALS = Credentials(FILE, "edge_front", "vision", "edge", "", {}, RIGHTS, 0.0, 1e12)


class Payload(bytes):
    """Stands in for ``zenoh.ZBytes``."""

    def to_bytes(self) -> bytes:
        return bytes(self)


@dataclass
class Router:
    """A router that lists what it accepted of one link, and counts how often it was asked.

    Also the node's link, and the clock: all that an access check sees.
    """

    now_s: float = 100.0
    asked: int = 0
    denies: set[str] = field(default_factory=set)
    keys: set[str] = field(default_factory=lambda: {KEY})
    ids: frozenset[str] = frozenset({"f0"})
    connected: bool = True
    session: Any = field(default_factory=lambda: SimpleNamespace(zid=lambda: OWN))

    def routers(self) -> frozenset[str]:
        return self.ids

    def declared(self) -> set[tuple[str, str]]:
        return {("queryable", key) for key in self.keys}

    def declare(self, declare: Callable[[Any], Any]) -> None:
        """Take the declaration of the holder, which is always accepted."""

    def answer(self, session: object, query: Query, done: Callable[[Replies], None]) -> None:
        self.asked += 1
        key = declared_expression(query.key)
        listed = {"routers": [], "peers": [], "clients": [] if key in self.denies else [OWN]}
        payload = Payload(json.dumps(listed).encode())
        sample: Any = SimpleNamespace(key_expr=f"@/f0/router/queryable/{key}", payload=payload)
        done(Replies([Reply(sample, None, "f0", 0, 0)]))


@pytest.fixture
def router(monkeypatch: pytest.MonkeyPatch) -> Router:
    router = Router()
    monkeypatch.setattr(access, "send", router.answer)
    monkeypatch.setattr(access, "time", SimpleNamespace(monotonic=lambda: router.now_s))
    return router


def check_of(router: Any) -> access.AccessCheck:
    return access.AccessCheck(router, CREDENTIALS)


def look_for(router: Router, check: access.AccessCheck, seconds: int) -> int:
    """Let a node look once a second; return how often it asked the router."""
    before = router.asked
    for _ in range(seconds):
        router.now_s += 1.0
        check.check(TOKEN)
    return router.asked - before


def test_a_router_that_denies_nothing_is_asked_once_a_minute(router: Router):
    check = check_of(router)
    assert look_for(router, check, 3) == 1
    assert look_for(router, check, 50) == 0
    assert look_for(router, check, 60) == 1
    assert check.denied == ""


@pytest.mark.parametrize("change", ["another router", "another key", "another file"])
def test_what_changes_is_asked_for_within_two_looks(router: Router, change: str):
    check = check_of(router)
    look_for(router, check, 10)
    if change == "another router":
        router.ids = frozenset({"f1"})
    elif change == "another key":
        router.keys = {KEY + "/more"}
    else:
        check.credentials = replace(CREDENTIALS, ends_s=2e12)
    assert look_for(router, check, 2) == 1


def test_a_denied_key_is_said_and_asked_for_until_it_is_allowed(router: Router):
    check = check_of(router)
    look_for(router, check, 10)
    router.denies, router.ids = {KEY}, frozenset({"f1"})  # it has started again
    look_for(router, check, 4)
    assert f"the router denies: publish {KEY}" in check.denied
    assert look_for(router, check, 12) == 4
    router.denies = set()
    look_for(router, check, 4)
    assert check.denied == ""
