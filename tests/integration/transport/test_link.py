"""A node whose link got slower while its router was away: back all the same, with all it offers."""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import msgpack
import pytest
import zenoh

from tests.support.listening import Listener, living_nodes, newest, wait_for_nodes
from tests.support.publishing import PlainCamera
from tests.support.routing import ONE_WAY_S, Router, far, silent_listener
from tests.support.waiting import in_time, wait_until
from zenoh_vision.config.revisions import ParameterStore
from zenoh_vision.errors import ConfigurationError
from zenoh_vision.host import abandoned_threads
from zenoh_vision.messages import Centroid
from zenoh_vision.node.node import Node
from zenoh_vision.topics import topic_named
from zenoh_vision.transport import link, query
from zenoh_vision.transport.connection import Connection
from zenoh_vision.transport.link import Link
from zenoh_vision.transport.publisher import StreamPublisher
from zenoh_vision.transport.session import direct
from zv.edge.settings import EdgeSettings


@pytest.fixture(autouse=True)
def _tried_anew_soon(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(link, "REPLACE_AFTER_S", 0.3)


def test_a_node_is_back_with_all_that_it_offers_where_its_link_got_slower(
    router: Router, client: zenoh.Session, caplog: pytest.LogCaptureFixture
) -> None:
    camera = PlainCamera(client)
    with (
        far(router) as way,
        camera.at(20),
        Node(
            "seer",
            connection=Connection(connect=way.endpoint, timeout_s=20),
            publishes=["centroid"],
            parameters=ParameterStore(EdgeSettings()),
        ) as node,
    ):
        frames = in_time(node, node.frames(max_age_s=5), deadline_s=60)
        next(frames)
        way.delay_s = ONE_WAY_S
        router.kill()
        router.start()
        wait_for_nodes(client, "seer_front", deadline_s=40)
        centroids = Listener(client, "vision/front/centroid")
        health = Listener(client, "@vision/diagnostics/seer_front")
        changes = Listener(client, "@vision/param/seer_front/low")
        sent = camera.seq
        for frame in frames:
            header = node.header(frame)
            nothing = Centroid(header=header, found=False, x=None, y=None, box=None, area=None)
            node.publish("centroid", nothing)
            if frame.header.seq > sent and centroids.messages and health.messages:
                break
        assert not node.stopping, "no frame, no centroid or no health came in 60 s"
        assert newest(client, "@vision/node/seer_front").body["node"] == "seer_front"
        assert newest(client, "@vision/schema/Centroid").payload
        low = "@vision/set/seer_front/low"
        (answer,) = wait_until(lambda: list(client.get(low, payload=msgpack.packb(7.0))))
        assert answer.ok is not None
        wait_until(lambda: bool(changes.messages))
    assert "another session was opened" in caplog.text


def test_a_router_that_was_only_away_is_found_again_and_nothing_is_there_twice(
    router: Router, client: zenoh.Session, monkeypatch: pytest.MonkeyPatch
) -> None:
    attempts: list[zenoh.Session | None] = []
    try_once = link.try_session

    def noted(*how: Any) -> zenoh.Session | None:
        attempts.append(try_once(*how))
        return attempts[-1]

    monkeypatch.setattr(link, "try_session", noted)
    with Node("seer", connection=Connection(connect=router.endpoint, timeout_s=20)):
        wait_for_nodes(client, "seer_front")
        router.kill()
        wait_until(lambda: attempts == [None], 30, lambda: f"{attempts}")
        router.start()
        wait_for_nodes(client, "seer_front")
        replies = wait_until(lambda: list(client.get("@vision/node/seer_front")))
        assert len(replies) == 1
        health = Listener(client, "@vision/diagnostics/seer_front")
        wait_until(lambda: len(health.messages) >= 3)
        sent = [message.body["stamp_ns"] for message in health.messages]
        assert len(set(sent)) == len(sent)
    wait_until(lambda: "@vision/node/seer_front" not in living_nodes(client))


def test_what_was_undeclared_before_is_not_declared_on_the_next_session(
    router: Router, client: zenoh.Session, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.WARNING)
    kept, ended = [], []
    with far(router) as way:
        between = Link(Connection(connect=way.endpoint, timeout_s=20))
        between.declare(lambda session: session.declare_subscriber("a/**", direct(kept.append)))
        between.declare(
            lambda session: session.declare_subscriber("a/**", direct(ended.append))
        ).undeclare()
        way.delay_s = ONE_WAY_S
        router.kill()
        router.start()
        wait_until(lambda: "another session was opened" in caplog.text, 40)

        def arrived() -> bool:
            client.put("a/b", b"1")
            return bool(kept)

        wait_until(arrived, 20)
        assert ended == []
        between.close()
    assert not between.connected


def test_a_session_that_the_router_does_not_answer_is_replaced(
    router: Router,
    client: zenoh.Session,
    monkeypatch: pytest.MonkeyPatch,
    caplog: pytest.LogCaptureFixture,
) -> None:
    asked: list[zenoh.Session] = []

    def answer_all_but_the_first(
        session: zenoh.Session, _: query.Query, done: Callable[[query.Replies], None]
    ) -> None:
        asked.append(session)
        replies = query.Replies()
        replies.timed_out = session is asked[0]
        done(replies)

    monkeypatch.setattr(link, "ASK_INTERVAL_S", 0.1)
    monkeypatch.setattr(link, "send", answer_all_but_the_first)
    between = Link(Connection(connect=router.endpoint, timeout_s=20))
    first = between.session
    between.declare(lambda session: session.liveliness().declare_token("@vision/node/silent"))
    wait_until(lambda: len({id(session) for session in asked}) == 2, 20)
    assert first.is_closed()
    assert "the router does not answer: another session was opened" in caplog.text
    wait_until(lambda: "@vision/node/silent" in living_nodes(client))
    between.close()


def test_after_a_session_that_cannot_be_used_the_former_one_says_who_subscribes(
    router: Router,
    client: zenoh.Session,
    monkeypatch: pytest.MonkeyPatch,
    caplog: pytest.LogCaptureFixture,
) -> None:
    def answer_after_that(_: zenoh.Session, __: query.Query, done: Callable[[Any], None]) -> None:
        replies = query.Replies()
        replies.timed_out = "cannot be used" not in caplog.text
        done(replies)

    monkeypatch.setattr(link, "ASK_INTERVAL_S", 0.1)
    monkeypatch.setattr(link, "send", answer_after_that)
    between = Link(Connection(connect=router.endpoint, timeout_s=20))
    first = between.session

    def declare_on_the_first(session: zenoh.Session) -> zenoh.LivelinessToken:
        if session is not first:
            raise zenoh.ZError("closed")
        return session.liveliness().declare_token("@vision/node/silent")

    topic = topic_named("mask/compressed")
    stream = StreamPublisher(between, topic, "vision/front/mask/compressed", lambda *_: None)
    between.declare(declare_on_the_first)
    with client.declare_subscriber(stream.key, direct(lambda _: None)):
        wait_until(lambda: stream.demand.exists)
        wait_until(lambda: "cannot be used" in caplog.text, 20)
        assert stream.demand.exists
    wait_until(lambda: not stream.demand.exists)
    with client.declare_subscriber(stream.key, direct(lambda _: None)):
        wait_until(lambda: stream.demand.exists)
    assert between.session is first
    between.close()


def test_closing_does_not_wait_for_an_attempt_that_is_not_answered(
    router: Router,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(link, "REPLACE_AFTER_S", 0.1)
    between = Link(Connection(connect=router.endpoint, timeout_s=20))
    router.kill()
    with silent_listener(router.port):
        wait_until(lambda: "connect" in _threads(), 20)
        between.close()
        assert "link" not in _threads()
        assert abandoned_threads.any_is_alive()
    wait_until(lambda: "connect" not in _threads(), 20)


def test_closed_while_another_session_takes_over_it_leaves_neither(
    router: Router, client: zenoh.Session
) -> None:
    slow = threading.Event()
    declaring = threading.Event()

    def make(session: zenoh.Session) -> zenoh.LivelinessToken:
        if slow.is_set():
            declaring.set()
            time.sleep(0.3)  # not to wait for something: declaring is to take long
        return session.liveliness().declare_token("@vision/node/slow")

    with far(router) as way:
        between = Link(Connection(connect=way.endpoint, timeout_s=20))
        between.declare(make)
        slow.set()
        way.delay_s = ONE_WAY_S
        router.kill()
        router.start()
        assert declaring.wait(40)
        between.close()
        wait_until(lambda: not living_nodes(client), 5)


def test_while_the_router_is_away_a_camera_that_is_gone_is_still_said_to_be(
    router: Router, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = tmp_path / "health"
    monkeypatch.setenv("ZV_HEALTH_FILE", str(file))
    with Node("seer", connection=Connection(connect=router.endpoint, timeout_s=20)) as node:
        wait_until(file.exists)  # a thread of the node writes it
        router.kill()
        wait_until(lambda: not node.link.connected)
        node.health.failure = lambda: "the camera is gone"  # type: ignore[method-assign]
        said: list[str] = []

        def read() -> bool:
            said.append(file.read_text())
            return len(said) > 400

        wait_until(lambda: "gone" in file.read_text())
        wait_until(read)
        assert all("gone" in text for text in said)


def test_what_goes_wrong_in_an_attempt_does_not_end_the_attempts(
    router: Router, client: zenoh.Session, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(link, "REPLACE_AFTER_S", 0.1)
    attempts: list[int] = []

    def failing(*_: Any) -> None:
        attempts.append(1)
        raise ConfigurationError("the file is gone")

    monkeypatch.setattr(link, "try_session", failing)
    between = Link(Connection(connect=router.endpoint, timeout_s=20))
    router.kill()
    wait_until(lambda: len(attempts) > 1, 20)
    between.close()


def _threads() -> list[str]:
    return [thread.name for thread in threading.enumerate()]


def test_what_a_router_replies_about_tokens_is_told_from_what_the_session_itself_does(
    client: zenoh.Session,
) -> None:
    keys = [f"told/apart/{number}" for number in range(20)]
    shown = [client.liveliness().declare_token(key) for key in keys]
    for _ in range(20):
        query_for_tokens = query.Query("told/apart/*", timeout_s=10.0, tokens=True)
        (replies,) = query.ask(client, [query_for_tokens])
        assert sorted(reply.key for reply in replies if not reply.own) == sorted(keys)
    for each in shown:
        each.undeclare()
