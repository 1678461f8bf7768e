"""What pages are told of nodes, streams, health and parameters."""

import json
import time
from collections.abc import Hashable

import pytest

from common.messages import Diagnostics, Latency, NodeDescription, Parameter
from services.viewer.system import LINES, System


class Told:
    """A system and what it told."""

    def __init__(self) -> None:
        self.texts: list[dict] = []
        self.system = System("vision", self._say)

    def _say(self, text: str, replaces: Hashable | None) -> None:
        self.texts.append(json.loads(text))

    def last(self, op: str) -> dict:
        return [text for text in self.texts if text["op"] == op][-1]

    def count(self, op: str) -> int:
        return len([text for text in self.texts if text["op"] == op])


@pytest.fixture
def told() -> Told:
    return Told()


def description(node: str = "camera_front", *publishes: str) -> NodeDescription:
    return NodeDescription(
        node=node, service="camera", cameras=("front",), version="1", host="h", pid=1,
        started_ns=5, publishes=publishes, subscribes=(), stamp_ns=7,
    )  # fmt: skip


def report(level: int, message: str, node: str = "camera_front") -> Diagnostics:
    return Diagnostics(
        node=node, stamp_ns=9, level=level, message=message, uptime_s=1.0, counters={},
        rate_hz=1.0, latency_ms=Latency(p50=None, p99=None),
    )  # fmt: skip


def test_streams_come_with_their_nodes_and_stay_as_gone_when_those_go(told):
    keys = ("vision/front/image/compressed", "vision/front/centroid", "@vision/x", "other/front/y")
    told.system.token("camera_front", True)
    told.system.describe(description("camera_front", *keys))
    streams = told.last("streams")["streams"]
    assert [(each["key"], each["kind"], each["live"]) for each in streams] == [
        ("vision/front/centroid", "message", True),
        ("vision/front/image/compressed", "picture", True),
    ]
    assert streams[1]["topic"] == "image/compressed"
    assert told.system.streams == ["vision/front/centroid", "vision/front/image/compressed"]
    told.system.token("camera_front", False)
    streams = told.last("streams")["streams"]
    assert [each["live"] for each in streams] == [False, False]
    assert all(each["since_ns"].isdecimal() for each in streams)
    assert told.system.streams == []


def test_of_two_nodes_with_one_key_the_one_that_lives_counts(told):
    for node in ("old", "new"):
        told.system.token(node, True)
        told.system.describe(description(node, "vision/front/image"))
    told.system.token("old", False)
    (stream,) = told.last("streams")["streams"]
    assert (stream["node"], stream["live"]) == ("new", True)


def test_what_has_not_changed_is_not_told_again(told):
    told.system.token("camera_front", True)
    for _ in range(3):
        told.system.describe(description("camera_front", "vision/front/image"))
        told.system.token("camera_front", True)
    assert told.count("streams") == 2  # empty, then with it
    assert told.count("log") == 1


def test_changes_of_health_make_lines_but_changing_numbers_do_not(told):
    told.system.token("camera_front", True)
    told.texts.clear()
    for seconds in range(3):
        told.system.health(report(3, f"no frame for {seconds} s"))
    told.system.health(report(0, "ok"))
    assert told.count("health") == 4
    assert [text["level"] for text in told.texts if text["op"] == "log"] == ["STALE", "OK"]


def test_a_report_is_as_old_as_its_arrival_whatever_its_nodes_clock_says(told):
    told.system.token("camera_front", True)
    before_ns = time.time_ns()
    told.system.health(report(0, "ok"))  # its stamp is of 1970
    assert before_ns <= int(told.last("health")["at_ns"]) <= time.time_ns()


def test_a_change_of_a_parameter_is_told_and_an_older_one_is_not(told):
    def low(value: float, revision: int) -> Parameter:
        return Parameter(
            node="edge", name="low", type="float", value=value, default=4.0, revision=revision
        )

    told.system.token("edge", True)
    told.system.parameters("edge", [low(4.0, 0)])
    told.system.parameter(low(9.0, 2))
    told.system.parameter(low(5.0, 1))  # overtaken on the way
    assert told.last("parameter")["parameter"]["value"] == 9.0
    assert told.last("log")["text"] == "low 4.0 -> 9.0"
    assert told.count("parameter") == 1


def test_a_new_page_is_told_all_and_the_last_lines(told):
    for number in range(LINES + 50):
        told.system.log("INFO", "", f"line {number}")
    told.system.router(True)
    told.system.token("camera_front", True)
    told.system.health(report(0, "ok"))
    everything = [json.loads(text) for text in told.system.everything()]
    lines = [text for text in everything if text["op"] == "log"]
    assert len(lines) == LINES
    assert lines[-1]["text"] == "is there"
    assert [text["op"] for text in everything[LINES:]] == ["router", "nodes", "streams", "health"]
    assert everything[LINES] == {"op": "router", "connected": True}


def test_health_of_nodes_without_a_token_is_nobodys(told):
    told.system.health(report(0, "ok", "ghost"))
    assert not told.texts
