"""``zv topic list`` and ``info``: what flows, without our making it flow."""

from __future__ import annotations

import json
import threading
import time
from collections.abc import Iterator
from contextlib import ExitStack
from typing import Any

import msgpack
import pytest
import zenoh

from tests.support import node_states
from tests.support.listening import known_queryable, open_client
from tests.support.pictures.encoded import STILL
from tests.support.publishing import (
    JPEG,
    Paced,
    counting,
    header,
    put_centroid,
    wait_for_subscriber,
)
from tests.support.waiting import DEADLINE_S, wait_until
from zenoh_vision.errors import ExpectationNotMet
from zenoh_vision.transport.connection import Connection
from zv.tools.shared.discovery import discover
from zv.tools.shared.session import ToolSession
from zv.tools.topic.options import (
    InfoOptions,
    ListOptions,
)


def test_one_does_not_count_oneself_among_the_subscribers(endpoint, client):
    with ToolSession(Connection(connect=endpoint, timeout_s=20)) as session:
        session.subscribe("vision/c/centroid", lambda _: None)
        client.declare_subscriber("vision/*/centroid", lambda _: None)

        def others() -> int | None:
            return discover(session).subscriber_count("vision/c/centroid")

        assert wait_until(others) == 1


def described(session: zenoh.Session, **fields: Any) -> zenoh.Queryable:
    """Answer for a node that publishes these keys."""
    description = node_states.description(**fields, version="9.9", host="far")

    def answer(query: zenoh.Query) -> None:
        with query:
            query.reply(f"@vision/node/{fields['node']}", description.to_bytes())

    return known_queryable(session, f"@vision/node/{fields['node']}", answer)


def entries(lines: list[str]) -> dict[str, dict[str, Any]]:
    return {(found := json.loads(line))["key"]: found for line in lines}


LAZY = "vision/c/mask/compressed"
CAMERA_INFO = "vision/c/camera_info"


@pytest.fixture
def node(client: zenoh.Session) -> Iterator[zenoh.Publisher]:
    """A node that describes itself; yields its publisher of a stream on demand."""
    queryable = described(
        client,
        node="tracker_c",
        publishes=(LAZY, "vision/c/centroid"),
        subscribes=("vision/c/image", CAMERA_INFO),
    )
    publisher = client.declare_publisher(LAZY)
    yield publisher
    publisher.undeclare()
    queryable.undeclare()


def test_a_list_shows_what_flows_and_leaves_alone_what_is_made_on_demand(
    client, endpoint, zv, node
):
    was_wanted = []
    watching = Paced(200, lambda: was_wanted.append(node.matching_status.matching))
    with (
        open_client(endpoint) as other,
        Paced(25, counting(client, "vision/c/centroid", put_centroid)),
        watching,
    ):
        foreign = client.declare_publisher("vision/x/image/compressed")
        other.declare_subscriber("vision/*/centroid", lambda _: None)
        wait_for_subscriber(client, "vision/c/centroid")
        with Paced(25, lambda: foreign.put(STILL, encoding=JPEG)):
            found = entries(zv(ListOptions(), as_json=True))
        foreign.undeclare()
    assert watching.calls > 20
    assert not any(was_wanted)
    assert found[LAZY] == {
        "key": LAZY,
        "type": "PNG",
        "encoding": "image/png",
        "publishers": ["tracker_c"],
        "subscribers": 0,
        "state": "on demand",
        "rate_hz": None,
    }
    centroid, picture = found["vision/c/centroid"], found["vision/x/image/compressed"]
    assert (centroid["type"], centroid["state"], centroid["subscribers"]) == (
        "Centroid",
        "flowing",
        1,
    )
    assert centroid["publishers"] == ["tracker_c"]
    assert centroid["rate_hz"] > 0  # how much of it, test_measure.py asks
    assert (picture["type"], picture["state"], picture["publishers"]) == ("JPEG", "flowing", ["?"])


def test_with_all_even_what_is_made_on_demand_is_asked_for(zv, node):
    wanted = threading.Event()
    with node.declare_matching_listener(lambda status: status.matching and wanted.set()):
        found = entries(zv(ListOptions(all_=True, window=0.5), as_json=True))
        assert wanted.wait(DEADLINE_S)
    assert found[LAZY]["state"] == "silent"


def test_a_stream_on_demand_that_someone_gets_already_is_measured(client, endpoint, zv, node):
    with open_client(endpoint) as other:
        other.declare_subscriber(LAZY, lambda _: None)
        wait_until(lambda: node.matching_status.matching)
        with Paced(25, lambda: node.put(b"x", encoding="image/png")):
            found = entries(zv(ListOptions(key="vision/c/**"), as_json=True))
    assert (found[LAZY]["state"], found[LAZY]["subscribers"]) == ("flowing", 1)


def test_only_what_flows_with_flowing(client, zv, node):
    with Paced(25, counting(client, "vision/c/centroid", put_centroid)):
        table = zv(ListOptions(flowing=True, window=1.0))
    assert table[0].split() == [
        "key",
        "type",
        "encoding",
        "publishers",
        "subscribers",
        "rate",
        "Hz",
    ]
    assert [line.split()[0] for line in table[2:]] == ["vision/c/centroid"]


def test_a_namespace_typed_wrong_says_what_exists(zv, node):
    with pytest.raises(ExpectationNotMet, match=f"nothing matches visoin/.*{LAZY}"):
        zv(ListOptions(key="visoin/**", window=0.1))


def test_info_shows_publishers_subscribers_and_the_newest_sample(client, zv, node):
    payload, stamp_ns = STILL, time.time_ns()

    def answer(query: zenoh.Query) -> None:
        with query:
            attachment = msgpack.packb(header(8, stamp_ns=stamp_ns, encoding="mono8"))
            query.reply(LAZY, payload, encoding=JPEG, attachment=attachment)

    queryable = known_queryable(client, LAZY, answer)
    (line,) = zv(InfoOptions(key=LAZY, window=0.2), as_json=True)
    found = json.loads(line)
    assert found["publishers"] == [
        {"node": "tracker_c", "host": "far", "pid": 77, "version": "9.9"}
    ]
    assert found["state"] == "on demand"
    assert found["made"] == "while someone subscribes or asks"
    assert found["newest"]["header"]["seq"] == 8
    assert found["newest"]["bytes"] == len(STILL)
    assert found["newest"]["age_ms"] >= 0
    text = zv(InfoOptions(key=LAZY, window=0.2))
    assert text[0] == LAZY
    assert "    - node: tracker_c" in text
    queryable.undeclare()


def test_info_says_how_the_pictures_of_a_camera_come_to_the_nodes_that_subscribe(client, zv, node):
    report = node_states.report("tracker_c", routes={"vision/c/image": "shm"})
    key = "@vision/diagnostics/tracker_c"

    def answer(query: zenoh.Query) -> None:
        with query:
            query.reply(key, report.to_bytes())

    queryable = known_queryable(client, key, answer)
    publishers = [client.declare_publisher(each) for each in ("vision/c/image", CAMERA_INFO)]
    found = entries(zv(InfoOptions(key="vision/c/*", window=0.1), as_json=True))
    picture, info = found["vision/c/image"], found[CAMERA_INFO]
    assert (picture["subscribers"], picture["subscribing_nodes"]) == (0, ["tracker_c"])
    assert picture["routes"] == {"tracker_c": "shm"}
    assert info["subscribing_nodes"] == ["tracker_c"]
    assert "routes" not in info
    for each in (queryable, *publishers):
        each.undeclare()


def test_info_does_not_say_when_a_stream_of_others_is_made(client, zv):
    publisher = client.declare_publisher("vision/foreign/image/compressed")
    (line,) = zv(InfoOptions(key="vision/foreign/image/compressed", window=0.1), as_json=True)
    found = json.loads(line)
    assert found["publishers"] == [{"node": "?"}]
    assert "made" not in found
    assert "delivery" not in found
    publisher.undeclare()


def test_a_description_without_end_is_left_out_at_once(client, zv, node):
    keys = tuple(f"vision/front/made_up_{n}" for n in range(20_000))
    began_s = time.process_time()
    with described(client, publishes=keys, node="liar"):
        lines = zv(ListOptions(window=0.1))
    assert 0 < len(lines) < 100
    assert time.process_time() - began_s < 5


def test_thousands_of_keys_are_listed_in_time_and_the_list_is_cut(client, zv, node):
    """Ten nodes with 500 keys each; quadratic, this took minutes."""
    began_s = time.process_time()
    with ExitStack() as kept:
        for n in range(10):
            keys = tuple(f"vision/front/made_up_{n}_{k}" for k in range(500))
            kept.enter_context(described(client, publishes=keys, node=f"busy{n}"))
        lines = zv(ListOptions(window=0.1))
    rows = [line for line in lines if line.startswith("vision/")]
    assert len(rows) == 2000
    assert time.process_time() - began_s < 20
