"""A node whose link got slower while its router was away: back all the same, with all it offers."""

from __future__ import annotations

import logging
from typing import Any

import msgpack
import pytest
import zenoh

from common import link
from common.connection import Connection
from common.link import Link
from common.live import LiveSettings
from common.messages import Centroid
from common.node import Node
from common.session import direct
from services.edge.settings import EdgeSettings
from tests.integration.far import ONE_WAY_S, far
from tests.integration.listening import Listener, living_nodes, wait_for_nodes
from tests.integration.publishing import PlainCamera
from tests.integration.routing import Router
from tests.integration.waiting import in_time, wait_until


@pytest.fixture(autouse=True)
def _tried_anew_soon(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(link, "ANEW_AFTER_S", 1.0)


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
            messages=[Centroid],
            parameters=LiveSettings(EdgeSettings()),
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
        (described,) = client.get("@vision/node/seer_front", timeout=5.0)
        assert msgpack.unpackb(described.ok.payload.to_bytes())["node"] == "seer_front"
        (schema,) = client.get("@vision/schema/Centroid", timeout=5.0)
        assert schema.ok is not None
        low = "@vision/param/seer_front/low"
        (answer,) = client.get(low, payload=msgpack.packb(7.0), timeout=5.0)
        assert answer.ok is not None
        wait_until(lambda: bool(changes.messages), 10)
    assert "another session was opened" in caplog.text


def test_a_router_that_was_only_away_is_found_again_and_nothing_is_there_twice(
    router: Router, client: zenoh.Session, monkeypatch: pytest.MonkeyPatch
) -> None:
    attempts: list[zenoh.Session | None] = []
    try_once = link.open_patiently

    def noted(*how: Any) -> zenoh.Session | None:
        attempts.append(try_once(*how))
        return attempts[-1]

    monkeypatch.setattr(link, "open_patiently", noted)
    with Node("seer", connection=Connection(connect=router.endpoint, timeout_s=20)):
        wait_for_nodes(client, "seer_front")
        router.kill()
        wait_until(lambda: attempts == [None, None], 30, lambda: f"{attempts}")
        router.start()
        wait_for_nodes(client, "seer_front")
        replies = list(client.get("@vision/node/seer_front", timeout=2.0))
        assert len(replies) == 1
        health = Listener(client, "@vision/diagnostics/seer_front")
        wait_until(lambda: len(health.messages) >= 3, 10)
        sent = [message.body["stamp_ns"] for message in health.messages]
        assert len(set(sent)) == len(sent)
    wait_until(lambda: "seer_front" not in living_nodes(client), 10)


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
