"""A camera's calibration: when one arrives, is replaced, is invalid or disappears."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from functools import partial

import msgpack
import pytest
import zenoh

from tests.support.listening import open_client
from tests.support.publishing import wait_for_subscriber
from tests.support.waiting import wait_until
from zenoh_vision import CameraInfo, Connection, Header, Node
from zenoh_vision.calibration.calibration import Calibration
from zenoh_vision.calibration.camera_model import CameraModel
from zenoh_vision.calibration.plane import Plane
from zenoh_vision.message_codec import MAX_MESSAGE_BYTES
from zenoh_vision.node.calibration_source import REPLY_S, CalibrationSource
from zenoh_vision.transport.query import Query, Replies, send

KEY = "vision/front/camera_info"
MODULE = "zenoh_vision.node.calibration_source"
LENS = CameraModel(640, 480, (500.0, 0, 320, 0, 500, 240, 0, 0, 1))


def header(epoch: int = 1) -> Header:
    now = time.time_ns()
    return Header(camera="front", epoch=epoch, seq=0, stamp_ns=now, width=640, height=480)


def calibrated(scale: float, camera: str = "front") -> bytes:
    """Return the message of a camera that looks at a plane of so many units a pixel."""
    plane = Plane((scale, 0, 0, 0, scale, 0, 0, 0, 1))
    own = header().model_copy(update={"camera": camera})
    return Calibration(LENS, plane=plane).message(own).to_bytes()


@pytest.fixture
def node(router) -> Iterator[Node]:
    with Node("tracker", connection=Connection(router.endpoint)) as node:
        yield node


@pytest.fixture
def source(node: Node) -> CalibrationSource:
    return CalibrationSource(node, "front")


def where(source: CalibrationSource, head: Header) -> tuple[float, float] | None:
    found = source.newest(head)
    return None if found is None or found.view is None else found.view.position(100, 50)


def test_a_calibration_applies_from_its_arrival_until_a_newer_one_replaces_it(
    source: CalibrationSource, client: zenoh.Session
):
    assert source.newest(header()) is None
    wait_for_subscriber(client, KEY)
    client.put(KEY, calibrated(0.01))
    wait_until(lambda: where(source, header()) == (1, 0.5))
    client.put(KEY, calibrated(0.02))
    wait_until(lambda: where(source, header()) == (2, 1))


def test_a_calibration_published_earlier_is_queried_and_dropped_when_its_publisher_is_gone(
    source: CalibrationSource, router
):
    with open_client(router.endpoint) as camera:
        queryable = camera.declare_queryable(KEY, lambda query: query.reply(KEY, calibrated(0.01)))
        wait_until(lambda: list(camera.get(f"@/*/router/queryable/{KEY}")))
        wait_until(lambda: where(source, header(epoch=5)) == (1, 0.5))
        queryable.undeclare()
        wait_until(lambda: not list(camera.get(f"@/*/router/queryable/{KEY}")))
        assert where(source, header(epoch=5)) is not None
    wait_until(lambda: source.newest(header(epoch=6)) is None)


def test_the_first_frame_of_an_epoch_waits_for_the_reply_and_no_longer_than_its_limit(
    source: CalibrationSource, router, monkeypatch: pytest.MonkeyPatch
):
    def answer(query: zenoh.Query) -> None:
        time.sleep(0.05)
        query.reply(KEY, calibrated(0.01))

    with open_client(router.endpoint) as camera:
        queryable = camera.declare_queryable(KEY, answer)
        wait_until(lambda: list(camera.get(f"@/*/router/queryable/{KEY}")))
        monkeypatch.setattr(f"{MODULE}.Query", partial(Query, timeout_s=20.0))
        with monkeypatch.context() as patched:
            patched.setattr(f"{MODULE}.REPLY_S", 20.0)
            assert where(source, header(epoch=5)) == (1, 0.5)
        queryable.undeclare()
        silent = threading.Event()
        queryable = camera.declare_queryable(KEY, lambda _: silent.wait(20))
        wait_until(lambda: list(camera.get(f"@/*/router/queryable/{KEY}")))
        begun_s = time.monotonic()
        assert where(source, header(epoch=6)) == (1, 0.5)
        assert not source._replied.is_set()
        assert time.monotonic() - begun_s >= REPLY_S
        silent.set()


def test_a_calibration_published_without_a_queryable_stays_through_later_epochs(
    source: CalibrationSource, client: zenoh.Session, monkeypatch: pytest.MonkeyPatch
):
    answers = []

    def counted(session: zenoh.Session, query: Query, done: Callable[[Replies], None]) -> None:
        send(session, query, lambda replies: (done(replies), answers.append(list(replies)))[0])

    monkeypatch.setattr(f"{MODULE}.send", counted)
    wait_for_subscriber(client, KEY)
    client.put(KEY, calibrated(0.01))
    wait_until(lambda: where(source, header(epoch=5)) == (1, 0.5))
    for epoch, answered in ((6, 2), (7, 3)):
        source.newest(header(epoch=epoch))
        wait_until(lambda: len(answers) == answered)  # noqa: B023 - waited for here
        assert where(source, header(epoch=epoch)) == (1, 0.5)
    assert answers == [[], [], []]


def test_a_calibration_is_decoded_by_the_loop_and_not_on_zenohs_thread(
    source: CalibrationSource, client: zenoh.Session, monkeypatch: pytest.MonkeyPatch
):
    readers = []
    read = CameraInfo.from_bytes

    def recorded(payload: bytes) -> CameraInfo:
        readers.append(threading.current_thread())
        return read(payload)

    monkeypatch.setattr(CameraInfo, "from_bytes", recorded)
    wait_for_subscriber(client, KEY)
    client.put(KEY, calibrated(0.01))
    wait_until(lambda: source.newest(header()))
    assert set(readers) == {threading.current_thread()}


def dropped(node: Node, reason: str) -> int:
    return node.counters.snapshot().get(f"dropped.{reason}", 0)


@pytest.mark.parametrize(
    ("payload", "reason"),
    [
        (b"\xc1", "bad_message"),
        (msgpack.packb({"k": 1}), "bad_message"),
        (calibrated(0.02, camera="back"), "wrong_camera"),
        (calibrated(0.02).replace(msgpack.packb(500.0), msgpack.packb(0.0)), "bad_calibration"),
    ],
    ids=["not msgpack", "not CameraInfo", "another camera's", "focal length 0"],
)
def test_an_invalid_calibration_is_dropped_and_counted_and_the_previous_one_stays(
    source: CalibrationSource, node: Node, client: zenoh.Session, payload: bytes, reason: str
):
    wait_for_subscriber(client, KEY)
    client.put(KEY, calibrated(0.01))
    wait_until(lambda: source.newest(header()))
    client.put(KEY, payload)
    wait_until(lambda: where(source, header()) and dropped(node, reason) == 1)
    assert where(source, header()) == (1, 0.5)
    counters = node.counters.snapshot()
    assert (counters["received"], counters["pending"]) == (1, 0)


def test_a_calibration_that_is_too_large_is_dropped_before_it_waits_for_a_frame(
    source: CalibrationSource, node: Node, client: zenoh.Session
):
    wait_for_subscriber(client, KEY)
    client.put(KEY, bytes(MAX_MESSAGE_BYTES + 1))
    wait_until(lambda: dropped(node, "bad_calibration") == 1)
    assert source.newest(header()) is None
