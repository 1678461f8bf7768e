"""What each role may do on each key, tried against zenohd, the embedded router, and two of them.

The table here is written by hand, from the contract of keys, and knows nothing of how rights are
derived.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest
import zenoh

from tests.support.routing import free_port
from tests.support.secured import Secured, embedded, move, official, secured
from tests.support.waiting import wait_until

CAMERA = {"image/compressed", "image", "camera_info", "truth"}
TRACKER = {
    "centroid", "tracks", "events", "prediction", "tracked/compressed", "mask/compressed",
    "background/compressed",
}  # fmt: skip
EDGE = {
    "edges/compressed", "edges/smoothed/compressed", "edges/magnitude/compressed",
    "edges/direction/compressed", "edges/suppressed/compressed", "edges/thresholded/compressed",
    "edges/contours",
}  # fmt: skip
PICTURES = {"image/compressed", "image"}

PUBLISHES = {
    "camera_front": {f"vision/front/{each}" for each in CAMERA},
    "tracker_front": {f"vision/front/{each}" for each in TRACKER},
    "edge_front": {f"vision/front/{each}" for each in EDGE},
    "brightness_front": {"vision/front/brightness"},
}
CONSUMES = {
    "tracker_front": {f"vision/front/{each}" for each in PICTURES | {"camera_info"}},
    "edge_front": {f"vision/front/{each}" for each in PICTURES},
    "brightness_front": {"vision/front/image/compressed"},
}
NODES = ("camera_front", "tracker_front", "edge_front", "brightness_front", "viewer", "recorder")
SEES_ALL = ("viewer", "recorder", "operator", "guest", "launcher")
SETS = ("viewer", "operator")
ROLES = (*NODES, "operator", "guest", "launcher")

DATA = [
    f"vision/{camera}/{suffix}"
    for camera in ("front", "back")
    for suffix in sorted(CAMERA | TRACKER | EDGE | {"brightness", "anything"})
]
SHOWN = (*NODES, "camera_back", "nobody")
SHARED = {camera: f"@vision/shm/{camera}/m/o" for camera in ("front", "back")}
CONTROL = [
    *(f"@vision/node/{node}" for node in SHOWN),
    *(f"@vision/diagnostics/{node}" for node in SHOWN),
    *(f"@vision/param/{node}" for node in SHOWN),
    *(f"@vision/param/{node}/quality" for node in SHOWN),
    *(f"@vision/set/{node}" for node in SHOWN),
    *(f"@vision/set/{node}/quality" for node in SHOWN),
    *(f"@vision/launch/{node}" for node in SHOWN),
    *(f"@vision/record/{node}" for node in ("recorder", "another")),
    *SHARED.values(),
    "@vision/schema/Centroid",
]
KEYS = [*DATA, *CONTROL, "other/front/image", "@other/node/camera_front", "@other/set/camera_front"]

EVERYWHERE = ("vision/**", "@vision/**")
"""What the witness sees. Other keys pass no router at all."""


def may(role: str, action: str, key: str) -> bool:
    """Say by the table whether somebody may do something."""
    publishes, consumes = PUBLISHES.get(role, set()), CONSUMES.get(role, set())
    is_node, sees = role in NODES, role in SEES_ALL
    kind, _, node = key.removeprefix("@vision/").partition("/")
    node = node.partition("/")[0]
    mine = key.startswith("@vision/") and is_node and node == role
    if kind == "shm":
        owner = role == "camera_front" and key == SHARED["front"]
        taker = key == SHARED["front"] and bool(consumes)
        return {
            "announce": owner,
            "watch": taker or sees,
            "subscribe": taker or role in ("viewer", "recorder"),
        }.get(action, False)
    if kind == "launch":
        return (action, role) in {("answer", "launcher"), ("query", "operator")}
    if kind == "record":
        own = key == "@vision/record/recorder" and role == "recorder"
        return (action == "answer" and (own or role == "operator")) or (
            action == "query" and role == "operator"
        )
    match action:
        case "publish":
            return (
                key in publishes
                or (mine and key.count("/") == 3) * (kind == "param")
                or (mine and kind == "diagnostics")
            )
        case "answer":
            own = mine and kind in ("node", "diagnostics", "param", "set")
            return key in publishes or own or (is_node and kind == "schema")
        case "subscribe":
            everything = key.startswith("vision/") or kind == "diagnostics"
            changes = kind == "param" and key.count("/") == 3
            return (
                key in consumes
                or (mine and kind == "diagnostics")
                or (sees and (everything or changes))
            )
        case "query":
            seen = kind in ("node", "diagnostics", "param", "schema")
            everything = key.startswith("vision/") or (key.startswith("@vision/") and seen)
            sets = role in SETS and kind == "set"
            return key in consumes or (mine and kind == "node") or (sees and everything) or sets
        case "announce":
            return mine and kind == "node"
        case "watch":
            return sees and key.startswith("@vision/node/")
    raise AssertionError(action)


AGAIN_S = 0.06
"""A report that came less than 0.05 s after another, perhaps of another test, was dropped."""


def pace(key: str) -> None:
    """Stay under the rate at which a router takes changes of one node's parameters."""
    if key.startswith("@vision/set/"):
        time.sleep(0.006)


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
    system = secured(folder, camera=("front", "back"))
    system.add(
        node="brightness_front",
        publishes=("vision/front/brightness",),
        subscribes=("vision/front/image/compressed",),
    )
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


def table(role: str, action: str) -> set[str]:
    return {key for key in KEYS if may(role, action, key)}


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

    def answered() -> set[str]:
        found = set()
        for key in KEYS:
            pace(key)
            if any(reply.ok for reply in meeting.witness.get(key, timeout=2.0)):
                found.add(key)
        return found

    expected = table(named, "answer")
    wait_until(lambda: expected <= answered())
    assert answered() == expected
    del kept


def test_asks_what_it_may_and_nothing_else(meeting: Meeting, named: str):
    asked: set[str] = set()

    def answer(query: zenoh.Query) -> None:
        with query:
            asked.add(str(query.key_expr))
            query.reply(query.key_expr, b"x")

    kept = [meeting.witness.declare_queryable(each, answer) for each in EVERYWHERE]
    meeting.settle()
    answered = set()
    for key in KEYS:
        pace(key)
        if any(reply.ok for reply in meeting.role.get(key, timeout=2.0)):
            answered.add(key)
    meeting.settle()
    assert answered == asked == table(named, "query")
    del kept


def test_shows_its_own_token_and_no_other(meeting: Meeting, named: str):
    kept = [meeting.role.liveliness().declare_token(key) for key in KEYS]
    meeting.settle()
    expected = table(named, "announce")

    def seen() -> set[str]:
        tokens = meeting.witness.liveliness()
        patterns = ("**", "@vision/**", "@other/**")
        return {
            str(r.ok.key_expr) for each in patterns for r in tokens.get(each, timeout=2.0) if r.ok
        }

    wait_until(lambda: expected <= seen())
    assert seen() == expected
    del kept


def test_sees_the_tokens_that_it_may_and_no_others(meeting: Meeting, named: str):
    kept = [meeting.witness.liveliness().declare_token(key) for key in KEYS]
    meeting.settle()
    expected = table(named, "watch")

    def seen() -> set[str]:
        tokens = meeting.role.liveliness()
        return {key for key in KEYS for r in tokens.get(key, timeout=2.0) if r.ok}

    wait_until(lambda: expected <= seen())
    assert seen() == expected
    followed: set[str] = set()
    following = [
        meeting.role.liveliness().declare_subscriber(
            key, lambda sample: followed.add(str(sample.key_expr)), history=True
        )
        for key in KEYS
    ]
    meeting.settle()
    wait_until(lambda: expected <= followed)
    assert followed == expected
    del kept, following
