"""Services are killed, cut off and frozen: each recovers, and nobody else notices."""

from __future__ import annotations

import os
import signal
import time
import urllib.error
import urllib.request
from contextlib import suppress

import pytest

from tests.support.containers.stack import OURS, SERVICES, Stack, pause, run
from tests.support.containers.witness import (
    CENTROID,
    EDGES,
    IMAGE,
    STREAMS,
    Witness,
    assert_whole,
    split,
)
from tests.support.listening import balance, newest, open_client
from tests.support.waiting import wait_until
from zenoh_vision.messages import Level

pytestmark = [pytest.mark.compose, pytest.mark.timeout(1500)]
KILLS = 5
KEY_OF = {"camera": IMAGE, "tracker": CENTROID, "edge": EDGES}
RESTART_S = 15.0
"""Docker waits 0.1, 0.2, 0.4, 0.8, 1.6 s, and a node loads for about a second."""


@pytest.mark.parametrize("service", OURS)
def test_a_service_that_is_killed_5_times_comes_back_and_the_others_go_on(
    stack: Stack, witness: Witness, service: str
):
    others = [other for other in OURS if other != service]
    starts = {other: stack.starts(other) for other in ("router", *others)}
    counted = {other: witness.counters(f"{other}_front") for other in others}
    began_s = time.monotonic()
    took = []
    for _ in range(KILLS):
        killed_s = stack.crash(service)
        found = witness[KEY_OF[service]].wait_for(1, RESTART_S, killed_s)
        took.append(found[0].at_s - killed_s)
        witness.flows(10, after_s=killed_s)
    print(f"{service} back after", " ".join(f"{seconds:.2f}" for seconds in took), "s")
    stack.wait_until_healthy()
    assert {other: stack.starts(other) for other in ("router", *others)} == starts
    for other in others:
        reports = [r["counters"] for r in witness.reports(f"{other}_front")]
        totals = [counters.get("received", counters.get("captured")) for counters in reports]
        assert totals == sorted(totals)
        after = witness.counters(f"{other}_front")
        assert balance(after) == 0
        assert all(
            after[name] >= value for name, value in counted[other].items() if name != "pending"
        )
    for key in STREAMS:
        seen = witness[key].after(began_s)
        assert_whole(seen)
        # The identity of frames is the camera's alone: nobody else's end changes it, and each
        # start of the camera is one new epoch.
        assert len({one.epoch for one in seen}) <= (1 + KILLS if service == "camera" else 1)
    if service == "camera":
        assert len({one.epoch for one in witness[IMAGE].after(began_s)}) >= KILLS


def test_a_viewer_that_is_killed_comes_back_under_the_same_address(stack: Stack, witness: Witness):
    stack.wait_until_healthy("viewer")
    starts = {other: stack.starts(other) for other in ("router", *OURS)}
    began_s = time.monotonic()
    killed_s = stack.crash("viewer")

    def answers() -> bool:
        # 401: it asks for its token, so it is there.
        address = f"http://127.0.0.1:{stack.viewer_port}/"
        try:
            urllib.request.urlopen(address, timeout=1)
        except urllib.error.HTTPError as error:
            return error.code == 401
        except OSError:
            return False
        return True

    wait_until(answers, RESTART_S)
    print(f"viewer back after {time.monotonic() - killed_s:.2f} s")
    stack.wait_until_healthy("viewer")
    assert {other: stack.starts(other) for other in ("router", *OURS)} == starts
    for key in STREAMS:
        seen = witness[key].after(began_s)
        assert_whole(seen)
        assert len({one.epoch for one in seen}) == 1


@pytest.mark.parametrize("seconds", [3, 30])
def test_a_camera_whose_network_was_gone_goes_on_with_its_newest_frame(
    stack: Stack, witness: Witness, seconds: float
):
    starts = {service: stack.starts(service) for service in OURS}
    began_s = time.monotonic()
    for key in STREAMS:  # what is missing shows only between frames that were seen
        witness[key].wait_for(1, 15, began_s)
    stack.cut_off("camera")
    pause(seconds)
    # Its source goes on; the network is not its source.
    assert stack.health("camera") == "healthy"
    stack.reconnect("camera")
    connected_s = time.monotonic()
    took_s = witness.back_s(connected_s)
    witness.flows(30, after_s=connected_s)
    print(f"gone {seconds} s, back after {took_s:.2f} s")
    for key in STREAMS:
        seen = witness[key].after(began_s)
        assert_whole(seen)
        assert len({one.epoch for one in seen}) == 1
        explained, strays = split(seen, [(began_s, connected_s + took_s)])
        print(f"{key}: {explained} missed while it was gone, {strays} else")
        assert explained >= 25 * seconds
        assert strays <= max(3, len(seen) // 100) + witness.counted_drops(key, began_s)
    assert {service: stack.starts(service) for service in OURS} == starts
    assert took_s < 5


def test_a_tracker_frozen_for_10_s_goes_on_with_the_newest_frame(stack: Stack, witness: Witness):
    container = stack.container("tracker")
    began_s = time.monotonic()
    run("docker", "pause", container)
    try:
        pause(10)
        newest_before = witness[IMAGE].after(began_s)[-1]
    finally:
        run("docker", "unpause", container)
    thawed_s = time.monotonic()
    # A frame that was in work when the freeze came is finished first, as it was.
    wait_until(lambda: len(fresh(witness, newest_before.seq)) >= 30, 30)
    first = fresh(witness, newest_before.seq)[0]
    old = [
        one
        for one in witness[CENTROID].after(thawed_s - 0.2)
        if one.seq < newest_before.seq - 15 and one.at_s < first.at_s
    ]
    print(
        f"first frame after the thaw {first.age_s * 1000:.0f} ms old, "
        f"{first.at_s - thawed_s:.2f} s after it; {len(old)} finished that were in work"
    )
    assert len(old) <= 1
    assert first.age_s < 0.4
    assert first.at_s - thawed_s < 2
    identities = [(one.epoch, one.seq) for one in witness[CENTROID].after(began_s)]
    assert identities == sorted(set(identities))
    for key in (IMAGE, EDGES):
        _, strays = split(witness[key].after(began_s), [])
        assert strays <= 10 + witness.counted_drops(key, began_s)
    counters = witness.counters("tracker_front")
    assert balance(counters) == 0
    print(counters)


def fresh(witness: Witness, seq: int) -> list:
    return [one for one in witness[CENTROID].after(0) if one.seq > seq - 15]


def test_health_tells_the_truth_of_a_frozen_tracker_and_of_a_camera_that_is_gone(new_stack):
    stack = new_stack(ZV_CAMERA_FAULTS="stall@300+999999", ZV_CAMERA_STALL_AFTER="2",
                      ZV_CAMERA_REOPEN_MIN="30")  # fmt: skip
    stack.wait_until_healthy()
    tracker = stack.container("tracker")
    run("docker", "pause", tracker)
    try:
        # Docker cannot ask a paused container, and says so itself.
        assert stack.inspect("tracker")["State"]["Status"] == "paused"
    finally:
        run("docker", "unpause", tracker)
    began_s = time.monotonic()
    wait_until(lambda: stack.health("camera") == "unhealthy", 40)
    print(f"unhealthy {time.monotonic() - began_s:.1f} s after the look began")
    assert "(unhealthy)" in stack.compose("ps", "camera")
    shown = stack.inspect("camera")["State"]["Health"]["Log"][-1]["Output"]
    assert "no picture for 2 s" in shown
    # Who has nothing to process does all there is to do.
    assert {stack.health(service) for service in ("tracker", "edge")} == {"healthy"}
    wait_until(lambda: stack.health("camera") == "healthy", 60)  # opened again


@pytest.mark.parametrize("service", SERVICES)
def test_a_process_that_is_frozen_makes_its_container_unhealthy_and_no_other(new_stack, service):
    # SIGSTOP to the process alone: init runs, so Docker's check does too.
    stack = new_stack()
    stack.wait_until_healthy()
    frozen = stack.worker(service)
    os.kill(frozen, signal.SIGSTOP)
    try:
        frozen_s = time.monotonic()
        wait_until(lambda: stack.health(service) == "unhealthy", 40)
        print(f"{service} unhealthy {time.monotonic() - frozen_s:.1f} s after it froze")
        assert {stack.health(other) for other in SERVICES if other != service} == {"healthy"}
        if service != "router":
            shown = stack.inspect(service)["State"]["Health"]["Log"][-1]["Output"]
            assert "has not been written for 5 s" in shown
    finally:
        with suppress(ProcessLookupError):  # the router that does not answer is killed and replaced
            os.kill(frozen, signal.SIGCONT)
    stack.wait_until_healthy()


def test_a_camera_that_cannot_be_opened_waits_for_its_source_and_says_why(new_stack):
    source = "rtsp://127.0.0.1:9/none"
    stack = new_stack(ZV_CAMERA_SOURCE=source)
    stack.wait_until_healthy("router", "tracker", "edge")
    with open_client(stack.endpoint) as session:
        key = "@vision/diagnostics/camera_front"
        wait_until(lambda: newest(session, key, 30).body["level"] == Level.ERROR, 30)
        report = newest(session, key, 30).body
    assert source in report["message"]
    state = stack.inspect("camera")
    assert (state["RestartCount"], state["State"]["Running"]) == (0, True)
    assert source in stack.logs("camera")
    assert "Traceback" not in stack.logs("camera")
