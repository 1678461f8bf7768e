"""zv doctor on the cameras: whether there are any, and at their rate."""

from __future__ import annotations

from tests.support.diagnosing import SMALL, WATCH_S, Diagnosis, levels
from tests.support.listening import newest, open_client, wait_until_listed
from tests.support.pictures.encoded import STILL
from tests.support.publishing import Paced
from tests.support.waiting import wait_until
from zenoh_vision.errors import ExpectationNotMet


def test_a_camera_that_lost_its_source_fails_with_what_it_says(shared, start):
    faults = ("--faults", "stall@3+100000", "--stall-after", 1, "--reopen-min", 60)
    start("camera", "--namespace", "lost", *SMALL, *faults)
    with open_client(shared.endpoint) as session:
        wait_until(lambda: levels(session, "lost", "camera_front") == [2])
    seen = Diagnosis(shared.endpoint, "lost")
    ((level, text, _),) = seen.of("cameras")
    assert level == "FAIL"
    assert text.startswith("camera_front: no picture for 1 s; opening synthetic again")
    assert ("FAIL", "health") not in seen.troubles  # it is said once
    assert isinstance(seen.error, ExpectationNotMet)


def test_a_camera_without_pictures_fails_before_it_says_so_itself(shared, start):
    faults = ("--faults", "stall@3+100000", "--stall-after", 3000)
    start("camera", "--namespace", "dark", *SMALL, *faults)
    with open_client(shared.endpoint) as session:
        newest(session, "dark/front/image/compressed")
        newest(session, "@dark/diagnostics/camera_front")
    seen = Diagnosis(shared.endpoint, "dark", for_s=2.2)
    ((level, text, _),) = seen.of("cameras")
    assert level == "FAIL"
    assert text.startswith("camera_front: no picture in ")


def test_the_expected_rate_may_come_from_the_parameter(shared, stand):
    stand(
        "camera_front",
        namespace="by_parameter",
        counters=lambda s: {"captured": int(12 * s), "published": int(12 * s)},
        parameters={"rate": {"value": 30.0}},
    )
    ((level, text, remedy),) = Diagnosis(shared.endpoint, "by_parameter", for_s=WATCH_S).of(
        "cameras"
    )
    assert (level, text) == ("WARN", "camera_front: 12.0 Hz instead of 30 Hz")
    assert "zv param set camera_front rate=12" in remedy


def test_a_system_without_a_camera_is_told_so(shared, stand):
    stand("tracker_front", namespace="blind")
    seen = Diagnosis(shared.endpoint, "blind")
    assert seen.of("cameras") == [
        ("WARN", "there is no camera", "zv camera --source synthetic"),
    ]
    assert seen.error is None  # a warning is no failure


def test_a_tracker_of_a_camera_that_is_not_there_is_told_which_are(shared, start, stand):
    stand("camera_front", namespace="wrong_camera")
    start("tracker", "--namespace", "wrong_camera", "--camera", "font")
    with open_client(shared.endpoint) as session:
        wait_until(lambda: levels(session, "wrong_camera", "tracker_font") == [3])
    seen = Diagnosis(shared.endpoint, "wrong_camera")
    ((level, text, remedy),) = seen.of("health")
    assert level == "WARN"
    assert text.startswith("tracker_font: no frame on wrong_camera/font/image/compressed")
    assert "cameras here: front" in remedy


def test_a_camera_that_is_not_a_node_is_one_even_where_there_is_no_node(shared):
    key = "plain/front/image/compressed"
    with open_client(shared.endpoint) as session, session.declare_publisher(key) as publisher:
        wait_until_listed(session, key)
        with Paced(20, lambda: publisher.put(STILL)):
            seen = Diagnosis(shared.endpoint, "plain", for_s=0.5)
    ((level, text, _),) = seen.of("cameras")
    assert level == "OK"
    rate, _, by = text.removeprefix(f"{key}: ").partition(" Hz from ")
    assert 0 < float(rate) < 30
    assert by == "a program that is not a node"


def test_a_camera_that_only_puts_is_found_where_someone_subscribes_to_it(shared):
    key = "putting/front/image"
    with open_client(shared.endpoint) as taker, open_client(shared.endpoint) as session:
        taker.declare_subscriber(key, lambda _: None)
        wait_until_listed(session, key, kind="subscriber")
        with Paced(20, lambda: session.put(key, b"x")):
            seen = Diagnosis(shared.endpoint, "putting", for_s=0.5)
        ((level, text, _),) = seen.of("cameras")
        assert (level, text.partition(":")[0]) == ("OK", key)
        assert Diagnosis(shared.endpoint, "putting", for_s=0.1).of("cameras") == []


def test_a_node_without_compressed_frames_is_pointed_to_the_raw_ones(shared, stand):
    raw = "crude/r1/image"
    stand(
        "tracker_r1",
        namespace="crude",
        subscribes=(f"{raw}/compressed",),
        health={"level": 3, "message": "no frame"},
        parameters={"transport": {"type": "str", "value": "jpeg"}},
    )
    with open_client(shared.endpoint) as session, session.declare_publisher(raw):
        wait_until_listed(session, raw)
        seen = Diagnosis(shared.endpoint, "crude")
    assert seen.of("cameras") == [("OK", f"{raw}: from a program that is not a node", "")]
    ((_, _, remedy),) = seen.of("health")
    assert remedy == (
        "nobody publishes crude/r1/image/compressed, but someone publishes crude/r1/image: "
        "zv param set tracker_r1 transport=auto"
    )


def test_a_node_that_waits_for_two_unpublished_keys_is_pointed_to_the_cameras(shared, stand):
    keys = ("empty/r1/image/compressed", "empty/r1/image")
    stand("camera_front", namespace="empty")
    silence = {"level": 3, "message": "no frame"}
    stand("tracker_r1", namespace="empty", subscribes=keys, health=silence)
    ((_, _, remedy),) = Diagnosis(shared.endpoint, "empty").of("health")
    assert remedy.startswith(f"nobody publishes {' or '.join(keys)}, cameras here: front")


def test_a_camera_of_another_program_whose_name_is_none_is_named_with_what_is_allowed(shared):
    with open_client(shared.endpoint) as session:
        publisher = session.declare_publisher("misnamed/cam-1/image/compressed")
        wait_until_listed(session, "misnamed/cam-1/image/compressed")
        seen = Diagnosis(shared.endpoint, "misnamed", for_s=0.1)
        publisher.undeclare()
    ((level, text, remedy),) = seen.of("names")
    assert level == "FAIL"
    assert "misnamed/cam-1/image/compressed, but 'cam-1' is no name of a camera" in text
    assert "such as cam_1" in remedy
