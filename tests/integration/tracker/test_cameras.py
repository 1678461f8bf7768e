"""One tracker of several cameras."""

from __future__ import annotations

from contextlib import ExitStack

import pytest

from tests.support.listening import Listener, newest, wait_for_nodes
from tests.support.publishing import PlainCamera
from tests.support.waiting import wait_until


@pytest.mark.parametrize("cameras", ["door,yard,away", "*"], ids=["by name", "by wildcard"])
def test_a_tracker_serves_several_cameras_and_an_absent_one_delays_none(service, client, cameras):
    service("tracker", "--camera", cameras)
    wait_for_nodes(client, "tracker")
    listeners = {name: Listener(client, f"vision/{name}/tracks") for name in ("door", "yard")}
    with ExitStack() as running:
        for name in listeners:
            running.enter_context(PlainCamera(client, camera=name).at(20))
        for listener in listeners.values():
            wait_until(lambda listener=listener: len(listener.messages) >= 5)
    for name, listener in listeners.items():
        assert {message.header["camera"] for message in listener.messages} == {name}
        assert {message.header["node"] for message in listener.messages} == {"tracker"}
    description = newest(client, "@vision/node/tracker").body
    assert set(listeners) <= set(description["cameras"])
    assert "vision/yard/tracks" in description["publishes"]
