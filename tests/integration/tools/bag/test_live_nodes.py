"""Which nodes publish what a replay would send."""

from __future__ import annotations

import os
import socket

import pytest
import zenoh

from tests.support.listening import open_client
from tests.support.node_states import description
from tests.support.routing import Router
from tests.support.waiting import wait_until
from zenoh_vision.node.node import Node
from zenoh_vision.testing import at
from zv.tools.bag.live_nodes import publishers

FRAMES, RESULTS = "vision/front/image/compressed", "vision/front/centroid"


@pytest.mark.parametrize("host", ["another container", socket.gethostname()])
def test_the_player_is_left_out_and_a_node_of_a_container_with_its_pid_is_found(
    host: str, router: Router
):
    about = description("camera_front", host=host, pid=os.getpid(), publishes=(FRAMES,))

    def reply(query: zenoh.Query) -> None:
        query.reply("@vision/node/camera_front", about.to_bytes())

    with (
        open_client(router.endpoint) as client,
        Node("player", connection=at(router.endpoint), publishes=["centroid"]) as player,
    ):
        client.declare_queryable("@vision/node/camera_front", reply)
        found = wait_until(  # until the router has passed the declaration on
            lambda: publishers(player.link, "vision", [FRAMES, RESULTS], lambda: False, player.name)
        )
    assert {key: each.host for key, each in found.items()} == {FRAMES: host}
