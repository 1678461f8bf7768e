"""How often a node asks its router what it has accepted, and what it says of what is missing."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from zenoh_vision.security.credentials import Credentials, Validity
from zenoh_vision.security.rights import Rights
from zenoh_vision.transport import access
from zenoh_vision.transport.query import Query, Replies, Reply

OWN, KEY, TOKEN = "ab", "vision/front/edges/contours", "@vision/node/edge_front"
SHOWN = f"zenoh-vision/holder/edge_front/{OWN}"
RIGHTS = Rights.of([("publish", (KEY,)), ("answer", (KEY,)), ("announce", (TOKEN,))])
FILE = Path("security", "edge_front.json5")
VALIDITY = Validity("edge_front", FILE.parent, 0.0, 1e12)
CREDENTIALS = Credentials(FILE, "edge_front", "vision", "", {}, RIGHTS, VALIDITY)


@dataclass
class Router:
    """A router that repeats the tokens that it accepted of one link, and counts the questions.

    Also the node's link, and the clock: all that an access check sees.
    """

    now_s: float = 100.0
    asked: int = 0
    denies: set[str] = field(default_factory=set)
    keys: set[str] = field(default_factory=lambda: {KEY})
    tokens: set[str] = field(default_factory=set)
    session_replies: bool = True
    ids: frozenset[str] = frozenset({"f0"})
    connected: bool = True
    session: Any = field(default_factory=lambda: SimpleNamespace(zid=lambda: OWN))

    def routers(self) -> frozenset[str]:
        return self.ids if self.connected else frozenset()

    def declared(self) -> set[tuple[str, str]]:
        return {("queryable", key) for key in self.keys}

    def declare(self, declare: Callable[[Any], Any]) -> Any:
        """Take a token, or the declaration of the holder."""
        liveliness = SimpleNamespace(declare_token=lambda key: self.tokens.add(key) or key)
        session = SimpleNamespace(
            zid=lambda: OWN,
            liveliness=lambda: liveliness,
            declare_queryable=lambda key, handler: key,
        )
        return declare(session)

    def undeclare(self, declared: Any) -> None:
        self.tokens.remove(declared)

    def answer(self, session: object, query: Query, done: Callable[[Replies], None]) -> None:
        """Reply as the session does for each token, and again for those that were accepted."""
        self.asked += 1
        own = self.tokens if self.session_replies else ()
        assert query.tokens
        assert query.key == f"{SHOWN}/*/**"
        accepted = {key for key in self.tokens if key.split("/", 5)[-1] not in self.denies}
        replies = [*((key, True) for key in own), *((key, False) for key in accepted)]
        done(Replies(reply_of(key, own) for key, own in replies))


def reply_of(key: str, own: bool) -> Reply:
    sample: Any = SimpleNamespace(key_expr=key)
    return Reply(sample, None, "", 0, 0, own)


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
        check.credentials = replace(CREDENTIALS, validity=replace(VALIDITY, ends_s=2e12))
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


@pytest.mark.parametrize("is_denied", [False, True])
def test_it_does_not_matter_whether_the_session_itself_replies(router: Router, is_denied: bool):
    """Zenoh leaves its replies out if those of the router were quicker, as in a busy process."""
    router.session_replies = False
    router.denies = {KEY} if is_denied else set()
    check = check_of(router)
    look_for(router, check, 10)
    assert (check.denied != "") == is_denied


def test_there_is_one_token_for_each_key_that_is_declared_for_as_long_as_the_question(
    router: Router, monkeypatch: pytest.MonkeyPatch
):
    asked: list[Callable[[Replies], None]] = []
    monkeypatch.setattr(access, "send", lambda session, query, done: asked.append(done))
    check = check_of(router)
    router.keys |= {"@vision/param/edge_front", "vision/front/@own"}
    look_for(router, check, 3)
    assert router.tokens == {f"{SHOWN}/queryable/{KEY}"}
    router.keys = {KEY + "/more"}
    look_for(router, check, 3)
    assert router.tokens == {f"{SHOWN}/queryable/{KEY}/more"}
    for answered in (1, 2):  # it is asked again for what has changed meanwhile
        assert len(asked) == answered
        router.answer(None, Query(f"{SHOWN}/*/**", tokens=True), asked[-1])
        look_for(router, check, 3)
    assert router.tokens == set()


def test_a_node_that_declares_something_else_each_second_is_told_what_is_denied(router: Router):
    check = check_of(router)
    router.denies = {KEY}
    for second in range(20):
        router.keys = {KEY, f"{KEY}/{second}"}
        look_for(router, check, 1)
    assert f"the router denies: publish {KEY}" in check.denied


def test_who_declares_something_may_wait_for_zenoh_while_an_answer_comes(
    router: Router, monkeypatch: pytest.MonkeyPatch
):
    """Zenoh has locked the session then, and who declares something has locked the link."""

    def locked() -> Any:
        raise AssertionError("the link is used")

    def answer(session: object, query: Query, done: Callable[[Replies], None]) -> None:
        with monkeypatch.context() as patched:
            patched.setattr(router, "declared", locked)
            patched.setattr(router, "routers", locked)
            router.answer(session, query, done)

    monkeypatch.setattr(access, "send", answer)
    router.denies = {KEY}
    check = check_of(router)
    look_for(router, check, 10)
    assert f"the router denies: publish {KEY}" in check.denied


def test_a_router_that_is_slow_is_not_asked_again_meanwhile(
    router: Router, monkeypatch: pytest.MonkeyPatch
):
    asked: list[float] = []
    monkeypatch.setattr(access, "send", lambda session, query, done: asked.append(query.timeout_s))
    check = check_of(router)
    look_for(router, check, 30)
    assert asked == [access.ANSWER_S]
    router.ids = frozenset({"f1"})
    look_for(router, check, 30)
    assert len(asked) == 2


def test_what_two_routers_lacked_once_each_is_not_taken_for_denied(router: Router):
    """So it is with one that ends, and the one that takes its place."""
    check = check_of(router)
    router.denies = {KEY}
    look_for(router, check, 3)
    router.ids = frozenset({"f1"})
    assert look_for(router, check, 2) == 1
    router.denies = set()
    look_for(router, check, 1)
    assert check.denied == ""


def test_what_a_node_asked_before_it_lost_the_router_is_asked_again(
    router: Router, monkeypatch: pytest.MonkeyPatch
):
    asked: list[Callable[[Replies], None]] = []
    monkeypatch.setattr(access, "send", lambda session, query, done: asked.append(done))
    check = check_of(router)
    look_for(router, check, 3)
    router.connected = False
    asked[-1](Replies())
    look_for(router, check, 3)
    router.connected = True
    look_for(router, check, 3)
    assert len(asked) == 2
    assert check.denied == ""


def test_what_was_not_answered_in_time_is_not_taken_for_denied(
    router: Router, monkeypatch: pytest.MonkeyPatch
):
    check = check_of(router)
    look_for(router, check, 10)

    def late(session: object, query: Query, done: Callable[[Replies], None]) -> None:
        router.asked += 1
        replies = Replies()
        replies.timed_out = True
        done(replies)

    router.ids = frozenset({"f1"})
    monkeypatch.setattr(access, "send", late)
    assert look_for(router, check, 10) == 9  # it is asked again at once
    assert check.denied == ""


def test_what_the_file_does_not_grant_is_said_at_the_first_answer(router: Router):
    check = check_of(router)
    router.keys = {"vision/front/truth"}
    router.denies = router.keys
    assert look_for(router, check, 3) == 1
    assert "the router denies: publish vision/front/truth" in check.denied
    assert "no rule allows it to the certificate of edge_front" in check.denied


def test_what_the_file_grants_is_said_when_it_was_missing_twice(router: Router):
    check = check_of(router)
    router.denies = {KEY}
    assert look_for(router, check, 3) == 2
    assert check.denied == ""
    assert look_for(router, check, 1) == 0
    assert f"the router denies: publish {KEY}" in check.denied
    assert "its rules are older than the file of edge_front" in check.denied
