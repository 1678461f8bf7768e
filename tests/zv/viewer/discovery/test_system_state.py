"""What pages are told of nodes, streams, health and parameters."""

import asyncio
import json
import time
from collections import Counter
from collections.abc import Hashable, Mapping
from contextlib import suppress

import pytest

from tests.support import node_states
from zenoh_vision.errors import PayloadError
from zenoh_vision.health.fleet import MAX_NODES
from zenoh_vision.health.message_limits import MAX_PARAMETERS
from zenoh_vision.messages import Diagnostics, NodeDescription, Parameter, ParameterList
from zv.viewer import events
from zv.viewer.discovery import system_state
from zv.viewer.discovery.system_state import LINES, MAX_PUBLISHED, SystemState
from zv.viewer.websocket.sender import Outbox


class Told:
    def __init__(self) -> None:
        self.texts: list[dict] = []
        self.system = SystemState("vision", self._say)

    def _say(self, text: str, replaces: Hashable | None) -> None:
        self.texts.append(json.loads(text))

    def health(self, report: Diagnostics) -> None:
        self.system.take(report.node, report)

    def last(self, op: str) -> dict:
        self.system.flush()
        return [text for text in self.texts if text["op"] == op][-1]

    def count(self, op: str) -> int:
        self.system.flush()
        return len([text for text in self.texts if text["op"] == op])


@pytest.fixture
def told() -> Told:
    return Told()


def description(node: str = "camera_front", *publishes: str) -> NodeDescription:
    return node_states.description(node=node, publishes=publishes)


def report(level: int, message: str, node: str = "camera_front") -> Diagnostics:
    return node_states.report(node=node, level=level, message=message)


def test_streams_come_with_their_nodes_and_stay_as_gone_when_those_go(told):
    keys = ("vision/front/image/compressed", "vision/front/centroid", "@vision/x", "other/front/y")
    told.system.take("camera_front", True)
    told.system.describe(description("camera_front", *keys))
    streams = told.last("streams")["streams"]
    assert [(each["key"], each["kind"], each["live"]) for each in streams] == [
        ("vision/front/centroid", "message", True),
        ("vision/front/image/compressed", "picture", True),
    ]
    assert streams[1]["topic"] == "image/compressed"
    assert told.system.streams == ["vision/front/centroid", "vision/front/image/compressed"]
    told.system.take("camera_front", False)
    streams = told.last("streams")["streams"]
    assert [each["live"] for each in streams] == [False, False]
    assert all(each["since_ns"].isdecimal() for each in streams)
    assert told.system.streams == []


IMAGE = "vision/front/image/compressed"


def test_streams_of_programs_that_are_no_nodes_are_listed_until_long_after_their_end(
    told, monkeypatch
):
    told.system.set_published({IMAGE, "vision/front/my_thing"})
    image, thing = told.last("streams")["streams"]
    assert (image["node"], image["kind"], image["live"]) == ("", "picture", True)
    assert (thing["node"], thing["kind"], thing["type"]) == ("", "message", "")
    assert told.system.streams == [IMAGE, "vision/front/my_thing"]
    told.system.set_published({IMAGE})
    assert [each["live"] for each in told.last("streams")["streams"]] == [True, False]
    assert told.system.streams == [IMAGE]
    told.system.expire()
    assert len(told.last("streams")["streams"]) == 2, "not yet"
    monkeypatch.setattr(system_state, "FORGET_S", 0.0)
    told.system.expire()
    assert [each["key"] for each in told.last("streams")["streams"]] == [IMAGE]


def test_a_list_of_publishers_that_stays_the_same_is_told_once(told):
    for _ in range(3):
        told.system.set_published({IMAGE})
    assert told.count("streams") == 1


def test_a_stream_belongs_to_its_node_while_that_lives_and_then_to_another_publisher(told):
    told.system.take("camera_front", True)
    told.system.set_published({IMAGE})
    told.system.describe(description("camera_front", IMAGE))
    told.system.set_published({IMAGE})
    assert [each["node"] for each in told.last("streams")["streams"]] == ["camera_front"]
    told.system.take("camera_front", False)
    (stream,) = told.last("streams")["streams"]
    assert (stream["node"], stream["live"]) == ("camera_front", False)
    told.system.set_published({IMAGE})
    (stream,) = told.last("streams")["streams"]
    assert (stream["node"], stream["live"]) == ("", True)


def test_streams_without_end_are_cut_those_that_are_gone_first(told, monkeypatch):
    monkeypatch.setattr(system_state, "MAX_STREAMS", 3)
    told.system.set_published({"vision/a/x", "vision/b/x"})
    told.system.set_published({"vision/c/x", "vision/d/x"})
    assert len(told.last("streams")["streams"]) == 3
    assert told.system.streams == ["vision/c/x", "vision/d/x"]
    told.system.set_published({f"vision/e{number}/x" for number in range(9)})
    assert told.system.streams == ["vision/e0/x", "vision/e1/x", "vision/e2/x"]
    assert "more than 3 streams" in told.last("log")["text"]


def test_of_two_nodes_with_one_key_the_one_that_lives_counts(told):
    for node in ("old", "new"):
        told.system.take(node, True)
        told.system.describe(description(node, "vision/front/image"))
    told.system.take("old", False)
    (stream,) = told.last("streams")["streams"]
    assert (stream["node"], stream["live"]) == ("new", True)


def test_what_has_not_changed_is_not_told_again(told):
    told.system.take("camera_front", True)
    told.system.flush()
    for _ in range(3):
        told.system.describe(description("camera_front", "vision/front/image"))
        told.system.take("camera_front", True)
        told.system.flush()
    assert told.count("streams") == 2  # empty, then with it
    assert told.count("log") == 1


def test_changes_of_health_make_lines_but_changing_numbers_do_not(told):
    told.system.take("camera_front", True)
    told.texts.clear()
    for seconds in range(3):
        told.health(report(3, f"no frame for {seconds} s"))
    told.health(report(0, "ok"))
    assert told.count("health") == 4
    assert [text["level"] for text in told.texts if text["op"] == "log"] == ["STALE", "OK"]


def test_a_report_is_as_old_as_its_arrival_whatever_its_nodes_clock_says(told):
    told.system.take("camera_front", True)
    before_ns = time.time_ns()
    told.health(report(0, "ok"))  # its stamp is of 2025
    assert before_ns <= int(told.last("health")["at_ns"]) <= time.time_ns()


def test_frames_that_nobody_wanted_are_not_told_as_lost(told):
    told.system.take("camera_front", True)
    counters = {"captured": 100, "published": 3, "dropped.no_subscriber": 90, "dropped.stale": 5}
    unwanted = {"dropped.unwatched": 1, "dropped.unread": 1}
    told.health(
        report(0, "ok").model_copy(update={"counters": counters | unwanted | {"missed": 2}})
    )
    health = told.last("health")
    assert health["lost"] == 5 + 2  # stale and missed
    assert health["diagnostics"]["counters"]["dropped.no_subscriber"] == 90


def test_a_change_of_a_parameter_is_told_and_an_older_one_is_not(told):
    def low(value: float, revision: int) -> Parameter:
        return Parameter(
            node="edge", name="low", type="float", value=value, default=4.0, revision=revision
        )

    told.system.take("edge", True)
    told.system.set_parameters(ParameterList(node="edge", revision=0, parameters=(low(4.0, 0),)))
    told.system.take("edge", low(9.0, 2))
    told.system.take("edge", low(5.0, 1))  # overtaken on the way
    assert told.last("parameter")["parameter"]["value"] == 9.0
    assert told.last("log")["text"] == "low 4.0 -> 9.0"
    assert told.count("parameter") == 1


def test_a_new_page_is_told_all_and_the_last_lines(told):
    for number in range(LINES + 50):
        told.system.log("INFO", "", f"line {number}")
    told.system.router(True)
    told.system.take("camera_front", True)
    told.health(report(0, "ok"))
    pairs = [*told.system.overview(), *told.system.details()]
    everything = [json.loads(text) for text, _ in pairs]
    lines = [text for text in everything if text["op"] == "log"]
    assert len(lines) == LINES
    assert lines[-1]["text"] == "is there"
    ops = [text["op"] for text in everything[LINES:]]
    assert ops == ["router", "nodes", "streams", "matches", "health"]
    assert everything[LINES] == {"op": "router", "connected": True}


def test_what_no_page_shows_is_not_made(told, monkeypatch):
    shown: set[str] = set()
    told.system = SystemState("vision", told._say, shown.__contains__)
    told.system.take("camera_front", True)
    told.system.describe(description("camera_front", "vision/front/image"))
    told.system.flush()
    made = []
    monkeypatch.setattr(events, "to_json", lambda fields: made.append(fields.get("op")) or "{}")
    changes = Parameter(node="camera_front", name="rate", type="int", value=1, default=1)
    for value in range(3):
        told.health(report(0, "ok"))
        told.system.take("camera_front", changes.model_copy(update={"value": value}))
        told.system.take("camera_front", bool(value % 2))
        told.system.flush()
    assert set(made) == {"log", None}  # lines, for those who look later, and items of the lists
    shown.update(("health", "parameters", "matches"))
    told.system.take("camera_front", True)
    told.health(report(0, "ok"))
    told.system.take("camera_front", changes.model_copy(update={"value": 7}))
    told.system.flush()
    assert {"health", "parameter", "matches"} <= set(made)


@pytest.mark.parametrize("flushed", [True, False])
def test_a_page_that_got_a_list_between_two_equal_ones_is_told_the_second(told, flushed):
    shown = {"matches"}
    told.system = SystemState("vision", told._say, shown.__contains__)

    def describe(*publishes: str) -> None:
        before = description("camera_front", *publishes)
        told.system.describe(before.model_copy(update={"subscribes": ("vision/*/image",)}))

    told.system.take("camera_front", True)
    describe("vision/front/image")
    told.system.flush()
    shown.clear()
    describe("vision/front/image", "vision/rear/image")
    if flushed:
        told.system.flush()
    page = {replaces: text for text, replaces in told.system.overview({"matches"})}
    shown.add("matches")
    told.texts.clear()
    describe("vision/front/image")
    told.system.flush()
    page |= {text["op"]: json.dumps(text) for text in told.texts}
    assert json.loads(page["matches"])["expressions"] == {"vision/*/image": ["vision/front/image"]}
    assert len(json.loads(page["streams"])["streams"]) == 1


def test_health_of_nodes_without_a_token_is_nobodys(told):
    told.health(report(0, "ok", "ghost"))
    assert not told.texts


def a_thousand_nodes(told: Told) -> None:
    for number in range(MAX_NODES):
        name = f"camera_{number:03}"
        told.system.take(name, True)
        topics = (f"vision/c{number}/image", f"vision/c{number}/centroid")
        told.system.describe(description(name, *topics))


def test_the_lists_of_a_thousand_nodes_are_made_once_and_not_for_each(told):
    a_thousand_nodes(told)
    assert (told.count("nodes"), told.count("streams")) == (1, 1)
    assert len(told.last("nodes")["nodes"]) == MAX_NODES
    assert len(told.system.streams) == 2 * MAX_NODES


def test_a_change_of_one_node_of_a_thousand_makes_the_texts_of_that_one_alone(told, monkeypatch):
    a_thousand_nodes(told)
    told.health(report(0, "ok", "camera_007"))
    told.system.flush()
    made: list[Mapping[str, object]] = []
    to_json = events.to_json
    monkeypatch.setattr(events, "to_json", lambda fields: made.append(fields) or to_json(fields))
    told.system.take("camera_007", False)
    told.system.flush()
    names = [fields.get("node") for fields in made if fields.get("op") != "matches"]
    assert names == ["camera_007"] * 4  # a line of the log, the node, its two streams
    made.clear()
    told.system.describe(description("camera_008", "vision/c8/image", "vision/c8/centroid"))
    told.system.flush()  # the same answer as before
    assert not made
    assert told.system.streams
    assert len([*told.system.overview(), *told.system.details()]) < LINES + 10
    ops = [fields["op"] for fields in made]
    assert ops == ["router", "matches", "health"]  # a new page makes no item of a list again


def test_a_page_that_shows_another_panel_makes_no_list_of_nodes(told, monkeypatch):
    told.system.take("camera_front", True)
    made = []
    monkeypatch.setattr(events, "list_text", lambda op, items: made.append(op) or "{}")
    ops = [replaces for _, replaces in told.system.overview({"matches", "log"}, new=False)]
    assert ops == [("log", 1), "matches"]
    assert told.system.overview({"health"}, new=False) == made == []


def test_a_node_that_names_endless_keys_is_cut_and_that_is_said_once(told):
    told.system.take("camera_front", True)
    keys = [f"vision/front/x{number}" for number in range(25_000)]
    for started_ns in (1, 2):
        told.system.describe(description("camera_front", *keys[started_ns:]))
    assert len(told.last("streams")["streams"]) == len(told.system.streams) == MAX_PUBLISHED
    assert len(told.last("nodes")["nodes"][0]["publishes"]) == MAX_PUBLISHED
    lines = [text["text"] for text in told.texts if text["op"] == "log"]
    assert lines == ["is there", "camera_front names more than 256 keys; the list is cut"]


def test_more_nodes_than_there_is_place_for_are_said_to_be_cut(told):
    a_thousand_nodes(told)
    with pytest.raises(PayloadError):
        told.system.take("one_more", True)
    assert told.last("log")["text"] == "there are 1000 nodes, the maximum; more are left out"


def test_endless_parameters_at_once_do_not_disconnect_a_page(told):
    outbox = Outbox(asyncio.Event())
    told.system = SystemState("vision", outbox.put)
    told.system.take("edge", True)
    for number in range(2000):
        one = Parameter(node="edge", name=f"p{number}", type="int", value=1, default=1)
        with suppress(PayloadError):
            told.system.take("edge", one)
    assert not outbox.full
    count = Counter(json.loads(text)["op"] for text in iter(outbox.take, None))
    assert count == {"log": LINES, "parameter": MAX_PARAMETERS}


def test_what_waits_for_a_page_of_a_thousand_nodes_does_not_disconnect_it(told):
    outbox = Outbox(asyncio.Event())
    told.system = SystemState("vision", outbox.put)
    a_thousand_nodes(told)
    for number in range(MAX_NODES):
        told.health(report(1, "slow", f"camera_{number:03}"))
    told.system.flush()
    assert not outbox.full
    waiting = [json.loads(text)["op"] for text in iter(outbox.take, None)]
    count = Counter(waiting)
    assert count == {"log": LINES, "nodes": 1, "streams": 1, "matches": 1, "health": MAX_NODES}
