"""Events on the wire: none is lost, the last 100 answer a query, a new epoch ends the old one's."""

from __future__ import annotations

from collections.abc import Iterator

import msgpack
import numpy as np
import pytest
import zenoh

from tests.support.headers import header
from tests.support.listening import Listener, ask
from tests.support.track_walks import track
from tests.support.waiting import wait_until
from zenoh_vision import Frame, Node, Tracks
from zenoh_vision.config.revisions import ParameterStore
from zenoh_vision.transport.query import Query
from zenoh_vision.transport.query import ask as ask_tools
from zv.registry import published_by
from zv.tracker.camera_tracking import CameraTracking
from zv.tracker.event_publisher import EventPublisher
from zv.tracker.settings import TrackerSettings

KEY = "vision/front/events"
PIXELS = np.zeros((48, 64, 3), np.uint8)
SETTINGS = TrackerSettings(lines="gate 100,0 100,200", zones="belt 110,0 200,0 200,100 110,100")


@pytest.fixture
def node(connection) -> Iterator[Node]:
    with Node("tracker", connection=connection, publishes=["events"]) as opened:
        yield opened


def frame(seq: int, epoch: int = 100) -> Frame:
    stamp_ns = epoch * 10**9 + seq * 100_000_000
    return Frame(header(seq, epoch, stamp_ns=stamp_ns), PIXELS)


def ready(client: zenoh.Session, node: Node) -> Listener:
    """Return a listener that the node's publisher knows."""
    listener = Listener(client, KEY)
    wait_until(lambda: node.wanted("events"))
    return listener


def test_a_published_crossing_has_all_its_fields(client, node):
    listener = ready(client, node)
    publisher = EventPublisher(node, SETTINGS)
    publisher.update(frame(0), [track(60, 50)], SETTINGS)
    counts = publisher.update(frame(1), [track(140, 50)], SETTINGS)
    started, confirmed, crossed, entered = (each.body for each in listener.wait_for(4))
    assert [started["event"], confirmed["event"]] == ["started", "confirmed"]
    at = crossed.pop("header")
    assert (at["seq"], at["stamp_ns"], at["node"]) == (1, 100_100_000_000, "tracker_front")
    # Half way of the 100 ms from x = 60 to x = 140.
    assert crossed == {
        "event": "line_crossed",
        "id": 1,
        "zone": "gate",
        "direction": "left",
        "x": 100.0,
        "y": 50.0,
        "stamp_ns": 100_050_000_000,
        "count": 1,
    }
    assert (entered["event"], entered["zone"], entered["inside"]) == ("zone_entered", "belt", 1)
    zones, lines = counts
    assert zones is not None
    assert lines is not None
    assert (zones["belt"].inside, lines["gate"].left, lines["gate"].right) == (1, 1, 0)


def test_no_event_is_lost_for_a_subscriber_and_the_last_100_answer_a_query(client, node):
    """200 objects start in one frame: 400 events, more than any queue of frames holds."""
    listener = ready(client, node)
    publisher = EventPublisher(node, SETTINGS)
    publisher.update(frame(0), [track(5, 5, id_=id_) for id_ in range(200)], SETTINGS)
    heard = listener.wait_for(400)
    assert [each.body["id"] for each in heard[::2]] == list(range(200))
    # A plain `get` has the newest message, as on every stream.
    (newest,) = ask(client, KEY)
    assert newest.payload == heard[-1].payload
    assert newest.attachment == heard[-1].attachment
    # Without consolidation it has all that are kept, oldest first.
    replies = list(client.get(KEY, consolidation=zenoh.ConsolidationMode.NONE))
    kept = [reply.ok.payload.to_bytes() for reply in replies if reply.ok]
    assert kept == [each.payload for each in heard[-100:]]
    (asked,) = ask_tools(client, [Query(KEY)])
    assert [each.ok.payload.to_bytes() for each in asked if each.ok] == kept


def test_a_new_epoch_ends_the_tracks_under_the_identity_of_the_old_one(client, node):
    listener = ready(client, node)
    publisher = EventPublisher(node, SETTINGS)
    publisher.update(frame(7, 200), [track(150, 50)], SETTINGS)
    publisher.update(frame(0, 300), [track(150, 50)], SETTINGS)
    found = [
        (each.body["event"], each.body["header"]["epoch"], each.header["seq"])
        for each in listener.wait_for(8)
    ]
    assert found[3:5] == [("zone_left", 200, 7), ("ended", 200, 7)]
    assert found[5:] == [("started", 300, 0), ("confirmed", 300, 0), ("zone_entered", 300, 0)]


def test_a_clock_that_is_set_back_ends_the_tracks_and_the_new_time_counts_from_then_on(
    client, node
):
    listener = ready(client, node)
    publisher = EventPublisher(node, SETTINGS)
    publisher.update(frame(20), [track(60, 50)], SETTINGS)
    publisher.update(frame(9), [track(60, 50, id_=2)], SETTINGS)
    publisher.update(frame(10), [track(140, 50, id_=2)], SETTINGS)
    found = [
        (each.body["event"], each.body["id"], each.body["stamp_ns"] // 10**6 - 100_000)
        for each in listener.wait_for(7)
    ]
    assert found[:3] == [("started", 1, 2000), ("confirmed", 1, 2000), ("ended", 1, 2000)]
    assert found[3:6] == [("started", 2, 900), ("confirmed", 2, 900), ("line_crossed", 2, 950)]


def test_a_tracker_continues_after_the_cameras_clock_was_set_back(connection):
    """By an hour, while a square moves on: without that, no time would pass for an hour."""
    live = ParameterStore(TrackerSettings())
    revision = live.activate()
    node = Node(
        "tracker",
        connection=connection,
        publishes=published_by("tracker"),
        parameters=live,
    )
    with node:
        tracking = CameraTracking(node, "front", live.active.settings)
        published: list[Tracks] = []
        publish = node.publish
        node.publish = lambda topic, message: (  # type: ignore[method-assign]
            published.append(message) if topic == "tracks" else publish(topic, message)
        )
        for number in range(80):
            hour_ns = 0 if number < 40 else -3600 * 10**9
            picture = np.full((120, 160, 3), 120, np.uint8)
            left = 5 + 5 * (number % 40) - 60
            picture[40:80, max(0, left) : max(0, left + 25)] = (10, 20, 200)
            each = Frame(
                header(number, stamp_ns=10**15 + hour_ns + number * 10**8, width=160, height=120),
                picture,
            )
            each.revision = revision
            tracking.process(each, picture)
    seen = [
        {track.id for track in message.tracks if track.state == "confirmed"}
        for message in published
    ]
    assert any(seen[:40])
    assert any(seen[41:])
    assert not set().union(*seen[:40]) & set().union(*seen[41:])


def test_changed_lines_apply_from_the_next_frame_and_others_keep_their_counts(client, node):
    publisher = EventPublisher(node, SETTINGS)
    publisher.update(frame(0), [track(60, 50)], SETTINGS)
    publisher.update(frame(1), [track(140, 50)], SETTINGS)
    more = SETTINGS.model_copy(update={"lines": f"{SETTINGS.lines}; exit 150,0 150,200"})
    publisher.update(frame(2), [track(140, 50)], more)
    _, lines = publisher.update(frame(3), [track(160, 50)], more)
    assert lines is not None
    assert {name: line.left for name, line in lines.items()} == {"gate": 1, "exit": 1}
    (newest, *_) = wait_until(lambda: ask(client, KEY))  # the router may not know of it yet
    assert msgpack.unpackb(newest.payload)["zone"] == "exit"


def test_shapes_in_world_units_without_a_calibration_are_logged_once_after_a_wait(node, caplog):
    settings = TrackerSettings(lines="pick world 0,0 0,1")
    publisher = EventPublisher(node, settings)
    told = "no events of pick: in world units, but the camera has no plane"
    for seq in range(20):  # 10 Hz
        publisher.update(frame(seq), [], settings)
    assert told not in caplog.messages
    for seq in range(20, 50):
        publisher.update(frame(seq), [], settings)
    assert caplog.messages.count(told) == 1
