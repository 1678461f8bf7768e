"""configs/compose/metrics.yml: one more container, scraped from outside."""

from __future__ import annotations

import urllib.request

import pytest

from tests.support.containers.witness import Witness
from tests.support.routing import free_port
from tests.support.waiting import wait_until

pytestmark = [pytest.mark.compose, pytest.mark.timeout(1500)]


def test_prometheus_is_served_on_this_machine_alone_and_the_container_is_healthy(new_stack):
    port = free_port()
    stack = new_stack("metrics", ZV_METRICS_PORT=str(port))

    def scraped() -> str:
        try:
            with urllib.request.urlopen(f"http://127.0.0.1:{port}/metrics", timeout=5) as answer:
                return answer.read().decode()
        except OSError:
            return ""

    with Witness(stack.endpoint) as witness:
        witness.flows(10)
        for node in ("camera_front", "tracker_front", "edge_front"):
            wait_until(
                lambda node=node: f'zenoh_vision_node_level{{node="{node}"}}' in scraped(), 30
            )
    assert "zenoh_vision_router_up 1.0" in scraped()
    stack.wait_until_healthy("metrics")
    bound = stack.inspect("metrics")["NetworkSettings"]["Ports"]["9464/tcp"]
    assert [one["HostIp"] for one in bound] == ["127.0.0.1"]
