"""Which nodes publish what a replay would send."""

from __future__ import annotations

import os

import zenoh

from tests.support.listening import open_client
from tests.support.routing import Router
from zenoh_vision.messages import NodeDescription
from zenoh_vision.node.node import Node
from zenoh_vision.testing import at
from zv.tools.bag.live_nodes import publishers

FRAMES, RESULTS = "vision/front/image/compressed", "vision/front/centroid"


def test_a_node_of_another_host_is_found_also_if_it_has_the_pid_of_the_player(router: Router):
    about = NodeDescription(
        node="camera_front",
        service="camera",
        cameras=("front",),
        version="1",
        host="another container",
        pid=os.getpid(),
        started_ns=1,
        publishes=(FRAMES,),
        subscribes=(),
    )

    def reply(query: zenoh.Query) -> None:
        query.reply("@vision/node/camera_front", about.to_bytes())

    with (
        open_client(router.endpoint) as client,
        Node("player", connection=at(router.endpoint), publishes=["centroid"]) as player,
    ):
        client.declare_queryable("@vision/node/camera_front", reply)
        found = publishers(player.link, "vision", [FRAMES, RESULTS], lambda: False)
    assert {key: each.host for key, each in found.items()} == {FRAMES: "another container"}
