"""Containers that share one /dev/shm: frames go through it, and each can die alone."""

from __future__ import annotations

import time

import pytest
import zenoh

from tests.support.containers.stack import Stack, run
from tests.support.containers.witness import IMAGE, Witness
from tests.support.listening import newest
from tests.support.waiting import wait_until

pytestmark = [pytest.mark.compose, pytest.mark.timeout(1500)]
CONSUMERS = ("tracker_front", "edge_front")
RESULTS = ("vision/front/centroid", "vision/front/edges/compressed")


def routes(session: zenoh.Session) -> set[str]:
    """Return how frames come to the consumers, as these say."""
    reports = [newest(session, f"@vision/diagnostics/{node}", 30).body for node in CONSUMERS]
    return {route for report in reports for route in (report["routes"] or {}).values()}


def by_shared_memory(session: zenoh.Session) -> bool:
    return routes(session) == {"shm"}


def memory_of(stack: Stack, service: str) -> list[str]:
    """Return the files in a container's /dev/shm."""
    return run("docker", "exec", stack.container(service), "ls", "/dev/shm").split()


def test_frames_go_through_the_shared_volume_and_a_crashed_camera_comes_back_there(new_stack):
    stack = new_stack("shared-memory")
    stack.wait_until_healthy()
    with Witness(stack.endpoint, RESULTS) as witness:
        witness.flows(60)
        wait_until(lambda: by_shared_memory(witness.session), 30)
        assert memory_of(stack, "camera") == memory_of(stack, "tracker")
        for client in ("router", "viewer"):
            assert not memory_of(stack, client)

        dead_s = stack.crash("camera")
        witness.flows(60, after_s=dead_s)
        wait_until(lambda: by_shared_memory(witness.session), 30)
        stack.compose("restart", "-t", "3", "tracker")
        witness.flows(60, after_s=time.monotonic())
        wait_until(lambda: by_shared_memory(witness.session), 30)
        with Witness(stack.endpoint, [IMAGE]) as remote:  # by JPEG, as ever
            remote.flows(30)


def test_a_shared_volume_that_is_too_small_leaves_the_frames_to_jpeg(new_stack):
    stack = new_stack("shared-memory", ZV_SHARED_MEMORY="1m")
    with Witness(stack.endpoint, RESULTS) as witness:
        witness.flows(60)
        assert routes(witness.session) == {"jpeg"}
        wait_until(lambda: "/dev/shm is full" in stack.logs("tracker"), 30)
