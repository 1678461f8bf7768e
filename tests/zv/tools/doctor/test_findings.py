"""What zv doctor finds out about streams: what is lost, who sends, and what mends it."""

from __future__ import annotations

import json
import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import pytest

from tests.support.diagnosing import observation
from tests.support.node_states import node_state, parameter, report
from zenoh_vision.health.counter_change import NOT_LOST
from zenoh_vision.health.node_state import NodeState
from zenoh_vision.messages import Level
from zv.registry import model_of
from zv.tools.doctor import remedies
from zv.tools.doctor.network import name_findings
from zv.tools.doctor.observation import Router, router_of
from zv.tools.doctor.other_cameras import OtherCamera
from zv.tools.doctor.streams import (
    camera_findings,
    health_findings,
    loss_findings,
    speed_findings,
)

ROOT = Path(__file__).parents[4]


# Losses


def observed(name: str, seconds: float, counters: dict[str, int], **about: object) -> NodeState:
    """Return a node whose counters went from zero to these in so many seconds."""
    reports = tuple(
        report(node=name, uptime_s=uptime_s, counters=counts)
        for uptime_s, counts in ((0.0, dict.fromkeys(counters, 0)), (seconds, counters))
    )
    return replace(node_state(name, service=name.partition("_")[0], **about), reports=reports)


@pytest.mark.parametrize("missed", [6, 12])
def test_what_a_camera_lost_is_compared_over_the_consumers_time(missed: int):
    # The camera loses 2 of 30 a second; its reports span 2 s, the tracker's 3 s.
    key = "vision/front/image/compressed"
    lost, arrived = {"dropped.overwritten": 4}, {"received": 90 - missed, "missed": missed}
    camera = observed("camera_front", 2.0, {"captured": 60, **lost}, publishes=(key,))
    tracker = observed("tracker_front", 3.0, arrived, subscribes=(key,))
    found = loss_findings(observation(camera, tracker))
    named = [finding.text.partition(" loses")[0] for finding in found]
    # Six are those that the camera lost itself; six more were lost on the way.
    assert named == ["camera_front", "tracker_front"][: missed // 6]


def test_losses_and_speed_are_unknown_while_no_node_has_reported_twice():
    tracker = observed("tracker_front", 3.0, {"received": 90, "missed": 60})
    (found,) = loss_findings(observation(replace(tracker, reports=tracker.reports[:1])))
    assert (found.level, found.check) == ("WARN", "drops")
    assert found.text.startswith("losses and speed are unknown: ")


# The router's own words


@pytest.mark.parametrize(
    ("said", "version", "sharing"),
    [
        (b'{"version": "v1.10.2-cc83980 built with rustc 1.97", "sessions": []}', "1.10.2", ()),
        (b'{"version": "1.9.0", "sessions": [{"peer": "a1", "shm": true}]}', "1.9.0", ("a1",)),
        (b'{"version": "v1.9.0", "sessions": [{"peer": "a1", "shm": false}]}', "1.9.0", ()),
        (b'{"sessions": null}', None, ()),
        (b"[1, 2]", None, ()),
        (b'{"sessions": [{"shm": true}]}', None, ()),
        (b"\xff", None, ()),
    ],
)
def test_what_a_router_says_in_another_form_is_left_out(said, version, sharing):
    router = router_of("z", said)
    assert (router.version, router.sharing) == (version, sharing)


# What mends a loss


def test_every_reason_of_the_documentation_has_a_remedy():
    text = (ROOT / "docs" / "messages.md").read_text()
    section = text.partition("## What is dropped, and under which name")[2].partition("\n## ")[0]
    rows = re.findall(r"^\| `(\w+)` \| (.*?) \|", section, re.MULTILINE)
    reasons = {reason for reason, where in rows if where != "`zv metrics`"}  # which is no node
    assert reasons - set(NOT_LOST) | {"missed"} == set(remedies.REMEDIES)


@pytest.mark.parametrize("reason", remedies.REMEDIES)
def test_a_parameter_that_is_named_exists(reason):
    remedy = remedies.REMEDIES[reason]
    services = ["camera"] if remedy.of_camera else ["camera", "tracker", "edge"]
    fields = set().union(*(model_of(service).model_fields for service in services))
    assert not remedy.parameter or remedy.parameter in fields


@pytest.mark.parametrize(
    ("value", "factor", "shown"), [(40, 0.75, "30"), (40, 1e308, "VALUE"), (1e300, 1e300, "VALUE")]
)
def test_a_value_is_proposed_if_there_is_such_a_number(value: float, factor: float, shown: str):
    known = {("edge_front", "quality"): parameter("edge_front", value, 0, "quality")}
    found = remedies.setting(observation(parameters=known), "edge_front", "quality", factor)
    assert found == f"zv param set edge_front quality={shown}"


@pytest.mark.parametrize("service", remedies.CHEAPER)
def test_what_makes_a_service_cheaper_are_options_of_it(service):
    assert set(remedies.CHEAPER[service]) <= set(model_of(service).model_fields)


# Cameras that are not nodes


@pytest.mark.parametrize(
    ("camera", "level", "text"),
    [
        (OtherCamera("v/a/image", 31, 3.0, 10.0), "OK", "v/a/image: 10.0 Hz from a program"),
        (OtherCamera("v/a/image", 1, 3.0), "OK", "v/a/image: from a program that is not a node"),
        (OtherCamera("v/a/image", 0, 3.0), "WARN", "v/a/image: nothing in 3.0 s from a program"),
        (OtherCamera("v/a/image", 0, 1.5), "OK", "v/a/image: from a program that is not a node"),
    ],
    ids=["flows", "a single frame", "silent", "too early to say"],
)
def test_a_camera_that_is_not_a_node_is_judged_by_what_arrives(camera, level, text):
    (finding,) = camera_findings(observation(others=(camera,)))
    assert (finding.level, finding.check) == (level, "cameras")
    assert finding.text.startswith(text)


def test_only_some_of_very_many_cameras_are_checked_and_that_is_reported():
    one = OtherCamera("v/a/image", 9, 3.0, 3.0)
    *_, last = camera_findings(observation(others=(one,), others_left_out=7))
    assert (last.level, last.text[:20]) == ("WARN", "7 more programs that")


def relay(camera: str, to: str) -> NodeState:
    key, own = (f"vision/{each}/image/compressed" for each in (camera, to))
    stale = report(node=f"relay_{to}", level=3, message="no frame")
    about = {"service": "relay", "subscribes": (key,), "publishes": (own,)}
    return node_state(f"relay_{to}", health=stale, **about)


@pytest.mark.parametrize("has_camera", [False, True])
def test_relays_that_get_pictures_only_from_each_other_are_named(has_camera: bool):
    nodes = [relay("a", "b"), relay("b", "a")]
    if has_camera:
        key = "vision/a/image/compressed"
        nodes.append(node_state("camera_a", service="camera", publishes=(key,)))
    remedies = [each.remedy for each in health_findings(observation(*nodes), ())]
    said = "relay_a and relay_b get pictures only from each other: give one of them the KEY of a"
    assert [each.startswith(said) for each in remedies] == [not has_camera] * 2


# Who sends, and what should run


ADDRESSES = {"a1": "tcp/10.0.0.2:51000", "b2": "tcp/10.0.0.7:51326", "me": "tcp/10.0.0.9:4"}
AT_ROUTER = {"r": Router("r", "1.10.2", (), ADDRESSES)}
KEY = "vision/front/image/compressed"


def test_a_program_with_a_declared_publisher_is_named_as_sender_of_refused_samples():
    seen = observation(
        node_state(session="a1", subscribes=(KEY,)),
        routers=AT_ROUTER,
        publishers={"vision/*/image/compressed": frozenset({"a1", "b2", "me"})},
        own="me",
    )
    remedy = remedies.remedy_for("bad_header", seen.nodes[0], seen)
    assert remedy == (
        f"a publisher violates the format of such messages: find who sends them: "
        f"zv topic info {KEY}; besides the nodes, it is published by "
        "session b2 from tcp/10.0.0.7:51326"
    )


def test_where_nobody_declared_a_publisher_all_programs_that_are_no_nodes_may_have_sent():
    seen = observation(
        node_state(session="a1", subscribes=(KEY,)),
        routers=AT_ROUTER,
        publishers={"other/key": frozenset({"c3"})},
        own="me",
    )
    remedy = remedies.remedy_for("corrupt", seen.nodes[0], seen)
    assert remedy.endswith("; programs here that are no nodes: session b2 from tcp/10.0.0.7:51326")


RAW = "vision/front/image"


def test_raw_pixels_without_a_header_are_told_to_have_one_and_no_second_publisher_is_named():
    tracker = node_state(session="a1", subscribes=(KEY, RAW))
    declared = {RAW: frozenset({"b2"})}
    seen = observation(tracker, routers=AT_ROUTER, publishers=declared)
    words = (
        f"the raw pixels on {RAW} have no header, which raw pixels need: send one, or send JPEGs "
        f"on {KEY}"
    )
    assert remedies.remedy_for("no_header", tracker, seen) == (
        f"{words}; besides the nodes, it is published by session b2 from tcp/10.0.0.7:51326"
    )
    undeclared = observation(tracker, routers=AT_ROUTER, others=(OtherCamera(RAW, 31, 3.0, 10.0),))
    assert remedies.remedy_for("no_header", tracker, undeclared) == words


def test_the_key_that_is_published_is_named_not_the_first_that_is_subscribed_to():
    tracker = node_state(session="a1", subscribes=(KEY, RAW))
    seen = observation(tracker, routers=AT_ROUTER, publishers={RAW: frozenset({"b2"})})
    assert f"zv topic info {RAW};" in remedies.remedy_for("wrong_size", tracker, seen)
    both = observation(tracker, publishers={RAW: frozenset("b"), KEY: frozenset("c")})
    assert remedies.remedy_for("no_header", tracker, both).startswith("a second publisher")


def test_frames_of_two_cameras_of_one_name_are_blamed_on_the_name():
    cameras = [
        node_state("camera_front", session, service="camera", publishes=(KEY,))
        for session in ("a1", "b2")
    ]
    tracker = node_state(session="t", subscribes=(KEY,))
    remedy = remedies.remedy_for("out_of_order", tracker, observation(*cameras, tracker))
    assert remedy == "there are several camera_front, see names: stop all but one"
    assert remedies.remedy_for("overwritten", tracker, observation(*cameras, tracker)) == remedy
    alone = remedies.remedy_for("out_of_order", tracker, observation(cameras[0], tracker))
    assert alone.startswith("two publishers share a key, or")


@pytest.mark.parametrize(
    ("cameras", "advice"),
    [((), "stop all but one"), (("a",), "stop all but one, or give each a --camera of its own")],
)
def test_only_nodes_with_a_camera_are_told_to_take_another(cameras: tuple[str, ...], advice: str):
    twins = [node_state("seer", session, cameras=cameras) for session in ("a1", "b2")]
    (found,) = name_findings(observation(*twins))
    assert (found.level, found.remedy) == ("FAIL", advice)


def test_a_routers_sessions_have_their_addresses():
    links = [{"src": "tcp/10.0.0.1:7447", "dst": "tcp/10.0.0.7:51326"}]
    sessions = [{"peer": "b2", "links": links, "shm": False}, {"peer": "c3", "links": []}]
    said = json.dumps({"version": "v1.10.2", "sessions": sessions}).encode()
    assert router_of("r", said).addresses == {"b2": "tcp/10.0.0.7:51326"}


def consumer(
    counters: dict[str, int], transport: str | None = None, service: str = "tracker"
) -> NodeState:
    """Return a consumer of the camera that counted this in 10 s."""
    reports = tuple(
        report(uptime_s=uptime_s, counters=counts, routes=transport and {KEY: transport})
        for uptime_s, counts in ((60.0, dict.fromkeys(counters, 0)), (70.0, counters))
    )
    state = node_state(f"{service}_front", "t", service=service, subscribes=(KEY,))
    return replace(state, reports=reports)


@pytest.mark.parametrize(
    ("transport", "begin", "command"),
    [
        ("shm", "more frames arrive than it can process", "zv param set camera_front rate=18"),
        ("jpeg", "frames are lost in the network", "zv param set camera_front quality=VALUE"),
        (None, "frames are lost in the network", "zv param set camera_front quality=VALUE"),
    ],
)
def test_frames_missed_in_shared_memory_are_not_blamed_on_the_network(transport, begin, command):
    camera = node_state("camera_front", service="camera", publishes=(KEY,), rate_hz=30.0)
    counters = {"received": 180, "processed": 180, "missed": 120}
    tracker = consumer(counters, transport)
    (found,) = loss_findings(observation(camera, tracker))
    assert "40.0 % of its frames as missed (120 in 10.0 s)" in found.text
    assert found.remedy.startswith(begin)
    assert found.remedy.endswith(command)


def test_what_a_recorder_misses_for_its_disk_is_not_blamed_on_the_network():
    recorder = observed("recorder", 3.0, {"received": 90, "missed": 60})
    first, last = recorder.reports
    slow = last.model_copy(update={"level": Level.WARN, "message": "the disk is too slow"})
    (found,) = loss_findings(observation(replace(recorder, reports=(first, slow))))
    assert found.remedy == "its health says why: the disk is too slow"
    (found,) = loss_findings(observation(recorder))
    assert found.remedy.startswith("frames are lost in the network")


def test_a_consumer_slower_than_a_slow_camera_names_the_rate_that_it_uses_and_so_does_the_camera():
    # 19.7 Hz of the 30 that are configured arrive, and 17.7 are used: at 27 Hz nothing changes.
    camera = camera_with([100, 297], 30.0, span_s=10.0)
    tracker = consumer({"received": 197, "processed": 177, "dropped.overwritten": 20})
    seen = observation(camera, tracker)
    (slow,) = speed_findings(seen)
    assert slow.text == f"tracker_front uses 17.7 of 19.7 Hz that arrive on {KEY}"
    assert "zv param set camera_front rate=17.7" in slow.remedy
    (under,) = camera_findings(seen)
    assert under.text == "camera_front: 19.7 Hz instead of 30 Hz"
    assert under.remedy.endswith("zv param set camera_front rate=17.7")


def test_a_consumer_of_two_cameras_uses_its_share_of_each():
    # 60 Hz arrive of two cameras with 30 each, half are used: 15 Hz of each.
    one, two = (
        node_state(name, name, service="camera", publishes=(f"vision/{name}/image",), rate_hz=30.0)
        for name in ("one", "two")
    )
    both = tuple(f"vision/{name}/image" for name in ("one", "two"))
    tracker = consumer({"received": 600, "processed": 300, "dropped.overwritten": 300})
    assert tracker.description is not None
    about = tracker.description.model_copy(update={"subscribes": both})
    (slow,) = speed_findings(observation(one, two, replace(tracker, description=about)))
    assert "zv param set one rate=15;" in slow.remedy


def test_a_small_loss_asks_for_a_tenth_less_and_what_others_cause_for_no_lower_rate():
    # 3 of 100 frames overwritten; half of them were damaged, which a lower rate does not mend.
    camera = node_state("camera_front", service="camera", publishes=(KEY,), rate_hz=30.0)
    tracker = consumer(
        {"received": 300, "processed": 141, "dropped.overwritten": 9, "dropped.corrupt": 150}
    )
    said = {each.text.split()[8]: each for each in loss_findings(observation(camera, tracker))}
    assert said["overwritten"].remedy.endswith("zv param set camera_front rate=27")


def camera_with(captured: Sequence[int], rate_hz: float = 10.0, span_s: float = 1.0) -> NodeState:
    """Return a camera that reported these totals, so many seconds apart."""
    reports = tuple(
        report(
            node="camera_front",
            uptime_s=60.0 + span_s * at,
            counters={"captured": total, "published": total, "pending": 0},
        )
        for at, total in enumerate(captured)
    )
    state = node_state("camera_front", service="camera", publishes=(KEY,), rate_hz=rate_hz)
    return replace(state, reports=reports)


def test_a_camera_that_has_stopped_is_not_told_to_run_slower():
    (found,) = camera_findings(observation(camera_with([100, 110, 115, 115, 115])))
    assert (found.level, found.text) == ("FAIL", "camera_front: no picture for the last 2.0 s")
    assert found.remedy.startswith("check its source")
    assert "rate" not in found.remedy


def test_two_cameras_of_one_name_are_told_apart_by_their_processes():
    one = camera_with([100, 110, 120])
    assert one.description is not None
    other = replace(
        one, session="b2", description=one.description.model_copy(update={"pid": 20908})
    )
    first, second = camera_findings(observation(one, other))
    rate = "10.0 Hz, 10 Hz expected"
    host, pid = one.description.host, one.description.pid
    assert first.text == f"camera_front (pid {pid} on {host}): {rate}"
    assert second.text == f"camera_front (pid 20908 on {host}): {rate}"
    (alone,) = camera_findings(observation(one))
    assert alone.text == f"camera_front: {rate}"


def test_a_camera_that_is_only_slow_is():
    (found,) = camera_findings(observation(camera_with([100, 105, 110, 115, 120])))
    assert found.level == "WARN"
    assert "5.0 Hz instead of 10 Hz" in found.text
    assert "rate=5" in found.remedy
