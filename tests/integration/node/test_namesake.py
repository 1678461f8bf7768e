"""Two nodes of one name: both say so, in log and health, until one is gone."""

from __future__ import annotations

import logging
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import pytest
import zenoh

from tests.support.listening import Listener, wait_for_nodes
from tests.support.node_states import description
from tests.support.waiting import wait_until
from zenoh_vision.health.health import Health
from zenoh_vision.messages import Level, NodeDescription
from zenoh_vision.node import announcement, namesake
from zenoh_vision.node.namesake import NamesakeMonitor
from zenoh_vision.node.node import Node
from zenoh_vision.stream.counters import FrameCounters
from zenoh_vision.transport.connection import Connection
from zenoh_vision.transport.query import Query, Replies, Reply


@pytest.fixture(autouse=True)
def _reports_come_often(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(announcement, "PERIOD_S", 0.2)
    monkeypatch.setattr(namesake, "ASK_AGAIN_S", 1.5)


def camera(connection: Connection) -> Node:
    return Node(
        "camera",
        connection=connection,
        publishes=["image/compressed"],
        counts=("captured", "published"),
    )


def test_two_cameras_of_one_name_both_tell_which_other_and_whose_frames_are_taken(
    connection: Connection, client: zenoh.Session, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.WARNING)
    with camera(connection) as older:
        wait_for_nodes(client, "camera_front")
        with camera(connection) as newer:
            wait_until(
                lambda: (
                    "pid" in older.health.message("namesake")
                    and "pid" in newer.health.message("namesake")
                )
            )
            pid = older._announcement.description().pid
            host = older._announcement.description().host
            for node, order in ((older, "later"), (newer, "earlier")):
                said = (
                    f"another node is called camera_front: pid {pid} on {host}, started {order} "
                    f"than this one (pid {pid}); "
                    "consumers take the frames of the one that opened its source last"
                )
                wait_until(lambda node=node, said=said: node.health.message("namesake") == said)
                report = node.health.diagnostics()
                assert (report.level, report.message) == (Level.WARN, said)
                told = f"{said}; stop one, or give it another name (--camera)"
                wait_until(lambda told=told: told in caplog.messages)
        wait_until(lambda: older.health.message("namesake") == "")
        assert older.health.diagnostics().level == Level.OK
        wait_until(lambda: "no other node is called camera_front any more" in caplog.text)


def test_a_node_that_publishes_no_frames_says_that_both_publish_on_its_keys(
    connection: Connection,
) -> None:
    with Node("seer", connection=connection) as one, Node("seer", connection=connection):
        wait_until(lambda: "both publish on the same keys" in one.health.message("namesake"))


def test_a_node_without_a_camera_is_not_told_to_take_another_camera(
    connection: Connection, caplog: pytest.LogCaptureFixture
) -> None:
    with (
        Node("seer", camera=(), connection=connection),
        Node("seer", camera=(), connection=connection),
    ):
        wait_until(lambda: any("; stop one" in each for each in caplog.messages))
    assert "--camera" not in caplog.text


def test_an_observer_and_another_camera_are_no_namesakes(
    connection: Connection, client: zenoh.Session
) -> None:
    listening = Listener(client, "@vision/diagnostics/**")
    with camera(connection) as node, Node("camera", camera="rear", connection=connection):
        wait_until(lambda: len(listening.messages) > 12)
        assert node.health.message("namesake") == ""


def monitor() -> tuple[NamesakeMonitor, Health]:
    health = Health("seer", FrameCounters())

    def describe() -> NodeDescription:
        raise AssertionError("is not asked")

    return NamesakeMonitor("seer", health, describe), health


def test_a_nodes_own_report_that_comes_back_over_its_former_session_is_no_other_node() -> None:
    watched, health = monitor()
    report = health.diagnostics()
    watched.note_own(report)
    watched._newest = report.to_bytes()
    watched.check()  # would ask on its link, which it does not have
    assert health.message("namesake") == ""


def test_without_a_router_the_silence_of_the_other_node_does_not_mean_that_it_is_gone(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr(namesake, "SILENT_S", -1.0)  # any silence is long enough
    watched, health = monitor()
    health.report("namesake", Level.WARN, "another node is called seer")
    watched._seen_s = 0.0
    link: Any = SimpleNamespace(connected=False)
    watched._link = link
    watched.check()
    assert (health.message("namesake"), caplog.messages) == ("another node is called seer", [])
    link.connected = True
    watched.check()
    assert (health.message("namesake"), caplog.messages) == (
        "",
        ["no other node is called seer any more"],
    )


@pytest.mark.parametrize("payload", [b"", b"\xc1", b"\x81\xa4node\xa4seer"])
def test_what_is_no_report_is_no_other_node(payload: bytes) -> None:
    watched, health = monitor()
    watched._newest = payload
    watched.check()
    assert health.message("namesake") == ""


def reply(number: int) -> Reply:
    about = description(node="seer", pid=1000 + number)
    sample: Any = SimpleNamespace(
        key_expr="@vision/node/seer", payload=zenoh.ZBytes(about.to_bytes())
    )
    return Reply(sample, None, "", 0, 0)


def test_of_thousands_of_descriptions_few_are_read(
    connection: Connection, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[Query] = []

    def answer(_session: object, query: Query, done: Callable[[Replies], None]) -> None:
        asked.append(query)
        done(Replies(reply(number) for number in range(500)))

    monkeypatch.setattr(namesake, "send", answer)
    health = Health("seer", FrameCounters())
    watched = NamesakeMonitor("seer", health, lambda: description(node="seer"))
    with Node("other", connection=connection) as node:
        watched.declare(node.link, "vision")
        watched._newest = health.diagnostics().to_bytes()
        watched.check()
    assert asked[0].most_bytes == 1 << 20
    assert len(watched._others) == 10


def test_a_report_is_sent_whatever_becomes_of_the_query_for_namesakes(
    connection: Connection, client: zenoh.Session, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(_monitor: NamesakeMonitor) -> None:
        raise zenoh.ZError("the session is closed")

    monkeypatch.setattr(NamesakeMonitor, "check", fail)
    reports = Listener(client, "@vision/diagnostics/seer")
    with Node("seer", camera=(), connection=connection):
        reports.wait_for(2)
