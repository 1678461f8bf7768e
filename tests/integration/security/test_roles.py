"""What each role may do on each key, tried against zenohd, the embedded router, and two of them.

The table is in tests/support/rights_table.py.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest
import zenoh

from tests.support.rights_table import KEYS, LIVE, ROLES, SUFFIXES, table
from tests.support.routing import free_port
from tests.support.secured import Secured, embedded, move, official, secured
from tests.support.waiting import wait_until
from zenoh_vision import keys
from zenoh_vision.topics import TOPICS
from zenoh_vision.transport.query import Query, ask
from zv.registry import SERVICES
from zv.tools.security.folder import Folder
from zv.tools.security.roles import GUEST, LAUNCHER, OPERATOR, OWN_NODE, PLAYER, ROUTER

EVERYWHERE = ("vision/**", "@vision/**", "zenoh-vision/holder/*")
"""What the witness sees. Other keys pass no router at all."""

PATTERNS = ("**", "@vision/**", "@other/**")
"""What tokens it asks for."""

ANSWER_S = 10.0
"""What is denied is answered at once by the router, so only a busy machine takes long."""

AGAIN_S = 0.06
"""A report that came less than 0.05 s after another, perhaps of another test, was dropped."""


@dataclass
class Place:
    """Where to connect: the role to one router, the witness to it or to one linked to it."""

    system: Secured
    role_port: int
    witness_port: int

    def role(self, name: str) -> zenoh.Session:
        return self.system.client(name, self.role_port)

    def witness(self) -> zenoh.Session:
        """Open a session that may do everything, as a router may."""
        return self.system.witness(self.witness_port)


@pytest.fixture(scope="module", params=["zenohd", "embedded", "two zenohd"])
def place(
    request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[Place]:
    folder: Path = tmp_path_factory.mktemp("roles")
    system = secured(folder, camera=LIVE)
    system.add(
        node="brightness_front",
        publishes=("vision/front/brightness",),
        subscribes=("vision/front/image/compressed",),
    )
    system.add(node="tracker", camera=LIVE)
    system.add(player=("walk",))
    if request.param == "embedded":
        with embedded(system, folder):
            yield Place(system, system.port, system.port)
        return
    if request.param == "zenohd":
        with official(system, folder):
            yield Place(system, system.port, system.port)
        return
    system.add(router="far", host=("localhost",))
    other = free_port()
    move(system, "far", other, system.endpoint)
    with official(system, folder), official(system, folder, "far"):
        place = Place(system, system.port, other)
        wait_until(lambda: linked(place))
        yield place


def linked(place: Place) -> bool:
    """Tell whether what one router's client declares reaches the other's."""
    with place.role("camera_front") as role, place.witness() as witness:
        kept = witness.declare_subscriber("vision/**", lambda _: None)
        publisher = role.declare_publisher("vision/front/image")
        deadline_s = time.monotonic() + 1
        while time.monotonic() < deadline_s:
            if publisher.matching_status.matching:
                kept.undeclare()
                return True
            time.sleep(0.05)
    return False


class Meeting:
    """A role and the witness, both connected, with a way to know that all has arrived."""

    def __init__(self, role: zenoh.Session, witness: zenoh.Session) -> None:
        self.role = role
        self.witness = witness

    def settle(self) -> None:
        """Return when what both have sent has been routed: all of it came before these queries.

        They ask for what no router lists: one that lists something may lock up (zenoh #2619).
        """
        for _ in range(2):
            for session in (self.role, self.witness):
                list(session.get("@/*/router/queryable/nothing", timeout=5.0))


@pytest.fixture(params=ROLES)
def named(request: pytest.FixtureRequest) -> str:
    return request.param


@pytest.fixture
def meeting(place: Place, named: str) -> Iterator[Meeting]:
    with place.role(named) as role, place.witness() as witness:
        yield Meeting(role, witness)


CHANGES = [key for key in KEYS if key.startswith("@vision/set/")]
OTHERS = [key for key in KEYS if key not in CHANGES]
PACE_S = 0.006
"""More than a router wants between two changes of one node's parameters; it drops the second."""


def answered_of(session: zenoh.Session) -> set[str]:
    """Return the keys on which somebody answers a session's queries."""
    asked = {key: session.get(key, timeout=ANSWER_S) for key in OTHERS}
    answered_s: dict[str, float] = {}
    for key in CHANGES:
        node = key.split("/")[2]
        time.sleep(max(0.0, answered_s.get(node, 0.0) + PACE_S - time.monotonic()))
        asked[key] = list(session.get(key, timeout=ANSWER_S))
        answered_s[node] = time.monotonic()
    return {key for key, replies in asked.items() if any(reply.ok for reply in replies)}


def test_every_role_and_every_topic_is_in_the_table(place: Place):
    holders = Folder(str(place.system.folder)).system().holders
    every = {*SERVICES, LAUNCHER, OPERATOR, GUEST, PLAYER, OWN_NODE} - {ROUTER}
    assert {holders[name].role.kind for name in ROLES} == every
    assert set(TOPICS) <= SUFFIXES


@pytest.mark.parametrize("action", ["publish", "subscribe"])
def test_sends_what_is_its_own_and_receives_what_it_consumes_and_nothing_else(
    meeting: Meeting, named: str, action: str
):
    sends = action == "publish"
    sender, receiver = meeting.role, meeting.witness
    if not sends:
        sender, receiver = receiver, sender
    arrived: set[str] = set()
    kept = [
        receiver.declare_subscriber(each, lambda sample: arrived.add(str(sample.key_expr)))
        for each in (EVERYWHERE if sends else KEYS)
    ]
    meeting.settle()
    expected = table(named, action)

    def all_arrived() -> bool:
        for key in KEYS:
            sender.put(key, b"x")
            if sends:
                sender.delete(key)
        meeting.settle()
        return expected <= arrived

    wait_until(all_arrived, poll_s=AGAIN_S, explain=lambda: f"{expected - arrived}")
    assert arrived == expected
    del kept


def test_answers_on_what_is_its_own_and_nowhere_else(meeting: Meeting, named: str):
    def answer(query: zenoh.Query) -> None:
        with query:
            query.reply(query.key_expr, b"x")

    kept = [meeting.role.declare_queryable(key, answer) for key in KEYS]
    meeting.settle()

    answered: set[str] = set()
    expected = table(named, "answer")

    def all_answered() -> bool:
        answered.clear()
        answered.update(answered_of(meeting.witness))
        return expected <= answered

    wait_until(all_answered)
    assert answered == expected
    del kept


def test_asks_what_it_may_and_nothing_else(meeting: Meeting, named: str):
    asked: set[str] = set()

    def answer(query: zenoh.Query) -> None:
        with query:
            asked.add(str(query.key_expr))
            query.reply(query.key_expr, b"x")

    kept = [meeting.witness.declare_queryable(each, answer) for each in EVERYWHERE]
    meeting.settle()
    answered = answered_of(meeting.role)
    meeting.settle()
    assert answered == asked == table(named, "query")
    del kept


def test_shows_its_own_token_and_no_other(meeting: Meeting, named: str):
    kept = [meeting.role.liveliness().declare_token(key) for key in KEYS]
    meeting.settle()
    expected = table(named, "announce")
    tokens = meeting.witness.liveliness()
    seen: set[str] = set()

    def all_seen() -> bool:
        replies = [r for each in PATTERNS for r in tokens.get(each, timeout=ANSWER_S)]
        seen.update(str(reply.ok.key_expr) for reply in replies if reply.ok)
        return expected <= seen

    wait_until(all_seen)
    assert seen == expected
    del kept


def test_only_its_router_takes_the_tokens_for_what_it_may_declare_and_no_other_router_gets_them(
    place: Place,
):
    with place.role("edge_front") as role, place.witness() as witness:
        zid = str(role.zid())
        streams = ("vision/front/edges/compressed", "vision/front/truth")
        shown = [keys.granted_key("edge_front", zid, "queryable", each) for each in streams]
        kept = [role.liveliness().declare_token(each) for each in shown]
        query = Query(keys.granted_key("edge_front", zid, "*", "**"), timeout_s=10.0, tokens=True)
        (own,) = ask(role, [query])
        assert [each.key for each in own if not each.own] == shown[:1]
        Meeting(role, witness).settle()
        (others,) = ask(witness, [query])
        assert others == []
        del kept


def test_sees_the_tokens_that_it_may_and_no_others(meeting: Meeting, named: str):
    kept = [meeting.witness.liveliness().declare_token(key) for key in KEYS]
    meeting.settle()
    expected = table(named, "watch")
    tokens = meeting.role.liveliness()
    seen: set[str] = set()

    def all_seen() -> bool:
        asked = {key: tokens.get(key, timeout=ANSWER_S) for key in KEYS}
        seen.update(key for key, replies in asked.items() if any(r.ok for r in replies))
        return expected <= seen

    wait_until(all_seen)
    assert seen == expected
    followed: set[str] = set()
    following = [
        tokens.declare_subscriber(
            key, lambda sample: followed.add(str(sample.key_expr)), history=True
        )
        for key in KEYS
    ]
    meeting.settle()
    wait_until(lambda: expected <= followed)
    assert followed == expected
    del kept, following
