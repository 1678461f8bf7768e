"""zv doctor on the nodes: their names, versions, clocks, health, and the namespace they are in."""

from __future__ import annotations

import time
from importlib.metadata import version

import pytest
import zenoh

from tests.support.diagnosing import SMALL, WATCH_S, Diagnosis
from tests.support.listening import newest, open_client
from tests.support.standing_in import DAY_S
from tests.support.waiting import wait_until
from zenoh_vision.errors import ExpectationNotMet
from zv.tools.doctor import observation
from zv.tools.shared.nodes import running_nodes


def test_of_a_system_that_is_well_every_line_is_ok_and_the_status_is_0(shared, start):
    start("camera", "--namespace", "well", *SMALL, "--rate", 10)
    start("tracker", "--namespace", "well")
    with open_client(shared.endpoint) as session:
        newest(session, "well/front/centroid")
        for node in ("camera_front", "tracker_front"):
            newest(session, f"@well/diagnostics/{node}")
    seen = wait_until(lambda: found_well(shared.endpoint))  # a busy machine may lose frames first
    assert seen.error is None
    assert [f["check"] for f in seen.found] == [
        *("files", "devices", "router", "memory", "namespace", "names", "answers", "versions"),
        *("clocks", "cameras", "drops", "speed", "health"),
    ]
    assert seen.of("router") == [
        ("OK", f"zenoh {version('eclipse-zenoh')} at {shared.endpoint}", ""),
    ]
    ((_, rate, _),) = seen.of("cameras")
    assert rate.startswith("camera_front: ")
    assert rate.endswith(" Hz, 10 Hz expected")


def found_well(endpoint: str) -> Diagnosis | None:
    seen = Diagnosis(endpoint, "well", for_s=3.0)
    return None if seen.troubles else seen


def test_nodes_are_looked_at_twice_however_long_the_first_replies_take(shared, stand, monkeypatch):
    stand("camera_front", namespace="lengthy")
    looks = []

    def slow_look(*arguments: object) -> object:
        looks.append(running_nodes(*arguments))
        time.sleep(WATCH_S)  # as replies with thousands of names do
        return looks[-1]

    monkeypatch.setattr(observation, "running_nodes", slow_look)
    Diagnosis(shared.endpoint, "lengthy", for_s=WATCH_S / 2)
    assert len(looks) == 2


def test_two_nodes_of_one_name_are_found_with_their_processes(shared, start):
    twins = [start("camera", "--namespace", "twins", *SMALL, "--rate", 5) for _ in range(2)]
    with open_client(shared.endpoint) as session:
        wait_until(lambda: len(every_answer(session, "@twins/node/camera_front")) == 2)
    seen = Diagnosis(shared.endpoint, "twins")
    ((level, text, remedy),) = seen.of("names")
    assert level == "FAIL"
    assert text.startswith("2 nodes are called camera_front")
    assert all(f"pid {twin.process.pid} on " in text for twin in twins)
    assert "--camera" in remedy
    assert isinstance(seen.error, ExpectationNotMet)


def every_answer(session: zenoh.Session, key: str) -> list[zenoh.Reply]:
    every = {"target": zenoh.QueryTarget.ALL, "consolidation": zenoh.ConsolidationMode.NONE}
    return list(session.get(key, timeout=2.0, **every))


def test_different_versions_are_listed_with_their_nodes(shared, stand):
    stand("camera_front", namespace="versions", version="0.0.7")
    stand("tracker_front", namespace="versions", version="0.1.0")
    seen = Diagnosis(shared.endpoint, "versions")
    ((level, text, _),) = seen.of("versions")
    assert level == "WARN"
    assert "0.0.7: camera_front; 0.1.0: this zv, tracker_front" in text


def test_a_clock_that_is_apart_is_measured_by_round_trips(shared, stand):
    stand("camera_front", namespace="clocks", clock_ahead_s=-2.5)
    stand("tracker_front", namespace="clocks", host="here")
    seen = Diagnosis(shared.endpoint, "clocks")
    ((level, text, remedy),) = seen.of("clocks")
    assert level == "WARN"
    assert text.startswith("the clock of elsewhere (camera_front) is -")
    measured_s = float(text.partition(" is ")[2].partition(" s ")[0])
    error_ms = float(text.partition("measured to ")[2].partition(" ms")[0])
    assert measured_s == pytest.approx(-2.5, abs=error_ms / 1e3 + 0.001)
    assert "NTP" in remedy


def test_a_clock_a_day_ahead_fails_since_its_frames_are_refused(shared, stand):
    stand("camera_front", namespace="tomorrow", clock_ahead_s=DAY_S + 60)
    ((level, text, _),) = Diagnosis(shared.endpoint, "tomorrow").of("clocks")
    assert level == "FAIL"
    assert "refused" in text


def test_a_namespace_typed_wrong_fails_and_names_what_there_is(shared, start):
    start("tracker", "--namespace", "greenhouse")
    with open_client(shared.endpoint) as session:
        newest(session, "@greenhouse/node/tracker_front")
    seen = Diagnosis(shared.endpoint, "grenhouse")
    ((level, text, remedy),) = seen.of("namespace")
    assert level == "FAIL"
    assert "no node in namespace grenhouse" in text
    assert "greenhouse: tracker_front" in text
    assert remedy == "--namespace greenhouse, or ZV_NAMESPACE=greenhouse"
    assert isinstance(seen.error, ExpectationNotMet)


def test_what_a_node_complains_of_otherwise_is_passed_on(shared, stand):
    stand("own_front", namespace="pain", health={"level": 2, "message": "the disk is full"})
    seen = Diagnosis(shared.endpoint, "pain")
    assert ("FAIL", "own_front: the disk is full", "see its log") in seen.of("health")


def test_a_node_that_shows_its_token_and_does_not_answer_fails(shared, stand):
    stand("camera_front", namespace="frozen", answers=False)
    seen = Diagnosis(shared.endpoint, "frozen")
    ((level, text, _),) = seen.of("answers")
    assert (level, text) == ("FAIL", "camera_front has a liveliness token but does not answer")


def test_a_node_that_reports_no_health_any_more_fails(shared, stand):
    stand("tracker_front", namespace="mute", health={"stamp_ns": time.time_ns() - 9_000_000_000})
    ((level, text, _),) = Diagnosis(shared.endpoint, "mute").of("answers")
    assert level == "FAIL"
    assert text.startswith("tracker_front has not reported its health for ")
