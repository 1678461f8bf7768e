"""Parameters as queries see them: what reads, what sets, and that nothing stops the server."""

from __future__ import annotations

from dataclasses import dataclass, field
from types import SimpleNamespace
from typing import Any

import msgpack
import pytest
import zenoh
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.support.clocks import SteppedClock
from tests.support.library import LIVE, LampSettings
from zenoh_vision.config.revisions import ParameterStore
from zenoh_vision.errors import ParameterRefused
from zenoh_vision.messages import Parameter, ParameterList, Refusal
from zenoh_vision.node.parameter_server import MAX_BYTES, MAX_LOGGED, ParameterServer

ALL = "@vision/param/lamp_front"
SET = "@vision/set/lamp_front"
MSGPACK = "application/msgpack"


@dataclass
class Bytes:
    content: bytes

    def __len__(self) -> int:
        return len(self.content)

    def to_bytes(self) -> bytes:
        assert len(self.content) <= MAX_BYTES, "copied though it is too large"
        return self.content


@dataclass
class Query:
    """What the server needs of a Zenoh query."""

    key_expr: zenoh.KeyExpr
    payload: Bytes | None = None
    encoding: Any = None
    good: list[tuple[str, dict[str, Any]]] = field(default_factory=list)
    bad: list[Refusal] = field(default_factory=list)

    def reply(self, key: str, payload: bytes, encoding: str) -> None:
        assert self.key_expr.intersects(zenoh.KeyExpr(key))
        kind = {
            f"{MSGPACK};vision.Parameter.v1": Parameter,
            f"{MSGPACK};vision.ParameterList.v1": ParameterList,
        }[encoding]
        self.good.append((key, kind.from_bytes(payload).to_map()))


class Lamp:
    """A server with its settings, asked without a network."""

    def __init__(self) -> None:
        self.live = ParameterStore(LampSettings())
        self.server = ParameterServer(self.live, "vision", "lamp_front")

    def ask(self, key: str, payload: bytes | None = None, encoding: str = MSGPACK) -> Query:
        sent = None if payload is None else Bytes(payload)
        query = Query(zenoh.KeyExpr(key), sent, None if sent is None else encoding)
        try:
            self.server.answer(query)  # type: ignore[arg-type]
        except ParameterRefused as refused:
            query.bad.append(Refusal(error=refused.error, allowed=refused.allowed))
        return query

    def set(self, key: str, value: object) -> Query:
        return self.ask(key, msgpack.packb(value))


@pytest.fixture
def lamp() -> Lamp:
    return Lamp()


def test_its_key_expression_takes_in_one_parameter_and_all(lamp: Lamp):
    own = zenoh.KeyExpr(lamp.server.key)
    assert own.includes(zenoh.KeyExpr(ALL))
    assert own.includes(zenoh.KeyExpr(f"{ALL}/power"))
    sets = zenoh.KeyExpr(lamp.server.set_key)
    assert sets.includes(zenoh.KeyExpr(SET))
    assert sets.includes(zenoh.KeyExpr(f"{SET}/power"))


def test_a_query_without_payload_reads_one_parameter(lamp: Lamp):
    ((key, found),) = lamp.ask(f"{ALL}/power").good
    assert key == f"{ALL}/power"
    assert (found["node"], found["name"], found["value"]) == ("lamp_front", "power", 50)
    assert found["revision"] == 0


def test_a_query_on_the_node_reads_all_at_one_revision(lamp: Lamp):
    lamp.set(f"{SET}/power", 7)
    ((key, found),) = lamp.ask(ALL).good
    assert (key, found["node"], found["revision"]) == (ALL, "lamp_front", 1)
    assert tuple(one["name"] for one in found["parameters"]) == LIVE
    assert {one["revision"] for one in found["parameters"]} == {1}


@pytest.mark.parametrize(
    ("expression", "keys"),
    [
        ("@vision/param/*/power", [f"{ALL}/power"]),
        (f"{ALL}/*", [f"{ALL}/{name}" for name in LIVE]),
        (f"{ALL}/**", [ALL, *(f"{ALL}/{name}" for name in LIVE)]),
        ("@vision/param/*", [ALL]),
        ("@vision/param/*/bulb", []),  # some other node may have it
        (f"{ALL}/l$*", [f"{ALL}/label", f"{ALL}/low"]),
    ],
)
def test_a_wildcard_reads_what_it_matches(lamp: Lamp, expression: str, keys: list[str]):
    query = lamp.ask(expression)
    assert [key for key, _ in query.good] == keys
    assert query.bad == []


def test_a_payload_sets_one_parameter_and_answers_with_it(lamp: Lamp):
    ((_, found),) = lamp.set(f"{SET}/power", 7).good
    assert (found["value"], found["default"], found["revision"]) == (7, 50, 1)
    assert lamp.live.newest.settings.power == 7


def test_nil_is_a_payload_like_any_other(lamp: Lamp):
    lamp.set(f"{SET}/blink", 5.0)
    ((_, found),) = lamp.set(f"{SET}/blink", None).good
    assert (found["value"], found["revision"]) == (None, 2)


def test_a_map_sets_several_and_answers_with_all(lamp: Lamp):
    ((_, found),) = lamp.set(SET, {"low": 5, "high": 7.5}).good
    values = {one["name"]: one["value"] for one in found["parameters"]}
    assert (found["revision"], values["low"], values["high"]) == (1, 5.0, 7.5)


REFUSED: dict[str, tuple[str, bytes, str, str]] = {
    "out of range": (f"{SET}/power", msgpack.packb(101), "power = 101", "from 0 to 100"),
    "a wrong one in a map": (SET, msgpack.packb({"power": 1, "low": "x"}), "low = 'x'", "a number"),
    "no map": (SET, msgpack.packb(5), "one value (int) cannot set", "a msgpack map"),
    "no msgpack": (f"{SET}/power", b"\xc1", "not msgpack", "a msgpack value"),
    "cut short": (SET, msgpack.packb({"power": 1})[:-1], "not msgpack", "a msgpack map"),
    "more behind it": (f"{SET}/power", b"\x05\x05", "not msgpack", "a msgpack value"),
    "empty": (f"{SET}/power", b"", "not msgpack", "a msgpack value"),
    "nested deep": (SET, b"\x91" * 5000, "not msgpack", "a msgpack map"),
    "huge": (f"{SET}/label", msgpack.packb("x" * MAX_BYTES), "a payload of 65541", "65536"),
    "no text": (f"{SET}/label", b"\xa2\xff\xfe", "not msgpack", "a msgpack value"),
    "unknown": (f"{SET}/bulb", msgpack.packb(5), "did you mean 'bulbs'?", "power, blink"),
    "not live": (f"{SET}/socket", msgpack.packb("x"), "cannot change while", "power, blink"),
    "below a parameter": (f"{SET}/power/x", msgpack.packb(5), "'power/x'", "power, blink"),
    "a wildcard": ("@vision/set/*/power", msgpack.packb(5), "without *", "power, blink"),
    "all nodes": ("@vision/set/*", msgpack.packb({"power": 5}), "without *", "power, blink"),
}


@pytest.mark.parametrize(("key", "payload", "error", "allowed"), REFUSED.values(), ids=REFUSED)
def test_a_wrong_change_is_refused_and_changes_nothing(
    lamp: Lamp, key: str, payload: bytes, error: str, allowed: str
):
    query = lamp.ask(key, payload)
    (refusal,) = query.bad
    assert (error in refusal.error, allowed in refusal.allowed) == (True, True), refusal
    assert query.good == []
    assert lamp.live.newest.number == 0


def test_text_is_not_taken_for_msgpack(lamp: Lamp):
    """The text ``5`` is the msgpack number 53."""
    (refusal,) = lamp.ask(f"{SET}/power", b"5", encoding="text/plain").bad
    assert (refusal.error, refusal.allowed.split()[0]) == ("a payload of text/plain", MSGPACK)
    for said in (f"{MSGPACK};vision.Parameter.v1", "zenoh/bytes"):
        assert lamp.ask(f"{SET}/power", b"\x05", encoding=said).bad == []


@pytest.mark.parametrize("name", ["", "/power"])
def test_a_payload_on_a_key_that_reads_is_refused_with_the_key_that_sets(lamp: Lamp, name: str):
    (refusal,) = lamp.set(f"{ALL}{name}", 5).bad
    assert refusal.error == (
        f"@vision/param/lamp_front{name} only reads parameters; "
        f"a change is sent to @vision/set/lamp_front{name}"
    )
    assert lamp.live.newest.number == 0


@pytest.mark.parametrize("name", ["", "/power"])
def test_a_change_without_payload_is_refused_with_the_key_that_reads(lamp: Lamp, name: str):
    (refusal,) = lamp.ask(f"{SET}{name}").bad
    assert refusal.error == "a change without a value"
    assert refusal.allowed.endswith(f"; @vision/param/lamp_front{name} reads")


def test_a_read_of_every_key_of_a_node_sets_nothing_and_is_no_fault(lamp: Lamp):
    assert len(lamp.ask("@vision/param/**").good) == 1 + len(LIVE)
    assert not zenoh.KeyExpr(lamp.server.key).intersects(zenoh.KeyExpr(lamp.server.set_key))


def test_a_parameter_that_is_not_there_cannot_be_read(lamp: Lamp):
    (refusal,) = lamp.ask(f"{ALL}/bulb").bad
    assert refusal.error == "there is no parameter 'bulb'; did you mean 'bulbs'?"


class Session:
    """Keeps what is put."""

    def __init__(self) -> None:
        self.put_: list[tuple[str, Parameter, str]] = []

    def put(self, key: str, payload: bytes, encoding: str, **_: Any) -> None:
        self.put_.append((key, Parameter.from_bytes(payload), encoding))


def test_each_value_that_changed_is_published_with_its_revision(lamp: Lamp):
    session = Session()
    lamp.server.publish_changes(SimpleNamespace(session=session))  # type: ignore[arg-type]
    lamp.set(SET, {"low": 0.5, "power": 50, "high": 7})
    lamp.set(f"{SET}/power", 500)
    lamp.set(f"{SET}/power", 51)
    lamp.set(f"{SET}/power", 51)
    found = [(key, one.value, one.revision) for key, one, _ in session.put_]
    assert found == [(f"{ALL}/low", 0.5, 1), (f"{ALL}/high", 7.0, 1), (f"{ALL}/power", 51, 2)]
    assert {said for _, _, said in session.put_} == {f"{MSGPACK};vision.Parameter.v1"}


def test_nothing_is_published_once_the_publishing_of_changes_has_ended(lamp: Lamp):
    session = Session()
    end = lamp.server.publish_changes(SimpleNamespace(session=session))  # type: ignore[arg-type]
    end()
    lamp.set(f"{SET}/power", 51)
    assert session.put_ == []


KEYS = st.sampled_from([SET, *(f"{SET}/{name}" for name in (*LIVE, "socket", "camera", "nothing"))])
SCALARS = st.none() | st.booleans() | st.integers(-(2**63), 2**64 - 1) | st.floats() | st.text()
VALUES = st.recursive(
    SCALARS | st.binary() | st.sampled_from(["red", "front", 0, 1, 2, 3.0, True]),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text() | st.binary(), inner),
    max_leaves=6,
)
MAPS = st.dictionaries(st.sampled_from([*LIVE, "socket", "camera", "x"]), VALUES, max_size=4)
PAYLOADS = st.binary() | (VALUES | MAPS).map(msgpack.packb)


@settings(deadline=None)
@given(st.lists(st.tuples(KEYS, PAYLOADS), max_size=5))
def test_whatever_is_sent_is_answered_once_and_leaves_settings_that_are_allowed(
    sent: list[tuple[str, bytes]],
):
    lamp = Lamp()
    for key, payload in sent:
        before = lamp.live.newest
        query = lamp.ask(key, payload)
        assert len(query.good) + len(query.bad) == 1
        after = lamp.live.newest
        if query.bad:
            assert after is before
            assert query.bad[0].allowed
        assert after.number in (before.number, before.number + 1)
        assert LampSettings.model_validate(after.settings.model_dump(), strict=True) is not None


def test_a_flood_of_changes_does_not_flood_the_log(caplog):
    clock = SteppedClock()
    lamp = Lamp()
    lamp.server._clock = clock
    link = SimpleNamespace(session=SimpleNamespace(put=lambda *_, **__: None))
    lamp.server.publish_changes(link)  # type: ignore[arg-type]
    numbers = range(1, 501)
    with caplog.at_level("INFO", "lamp_front"):
        for number in numbers:
            lamp.set(f"{SET}/power", number % 50)
        assert len(caplog.messages) == MAX_LOGGED
        clock.step(1.5)
        lamp.set(f"{SET}/power", 77)
    assert len(caplog.messages) == MAX_LOGGED + 1
    assert "490 changes before it were not logged" in caplog.messages[-1]
