"""The tracker's calibration: when one arrives, is replaced, is invalid or disappears."""

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
from zenoh_vision.transport.query import Query, Replies, send
from zv.tracker.camera_plane import REPLY_S, CameraPlane

KEY = "vision/front/camera_info"
LENS = CameraModel(640, 480, (500.0, 0, 320, 0, 500, 240, 0, 0, 1))


def header(width: int = 640, height: int = 480, epoch: int = 1) -> Header:
    now = time.time_ns()
    return Header(camera="front", epoch=epoch, seq=0, stamp_ns=now, width=width, height=height)


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
def plane(node: Node) -> CameraPlane:
    return CameraPlane(node, "front")


def where(plane: CameraPlane, head: Header) -> tuple[float, float] | None:
    view = plane.view(head)
    return None if view is None else view.position(100, 50)


def test_a_calibration_applies_from_its_arrival_until_a_newer_one_replaces_it(
    plane: CameraPlane, client: zenoh.Session
):
    assert plane.view(header()) is None
    wait_for_subscriber(client, KEY)
    client.put(KEY, calibrated(0.01))
    wait_until(lambda: where(plane, header()) == (1, 0.5))
    assert plane.view(header()) is plane.view(header())
    client.put(KEY, calibrated(0.02))
    wait_until(lambda: where(plane, header()) == (2, 1))


def test_a_calibration_published_earlier_is_queried_and_dropped_when_its_publisher_is_gone(
    plane: CameraPlane, router
):
    with open_client(router.endpoint) as camera:
        queryable = camera.declare_queryable(KEY, lambda query: query.reply(KEY, calibrated(0.01)))
        wait_until(lambda: list(camera.get(f"@/*/router/queryable/{KEY}")))
        wait_until(lambda: where(plane, header(epoch=5)) == (1, 0.5))
        queryable.undeclare()
        wait_until(lambda: not list(camera.get(f"@/*/router/queryable/{KEY}")))
        assert where(plane, header(epoch=5)) is not None
    wait_until(lambda: plane.view(header(epoch=6)) is None)


def test_the_first_frame_of_an_epoch_waits_for_the_reply_and_no_longer_than_its_limit(
    plane: CameraPlane, router, monkeypatch: pytest.MonkeyPatch
):
    def answer(query: zenoh.Query) -> None:
        time.sleep(0.05)
        query.reply(KEY, calibrated(0.01))

    with open_client(router.endpoint) as camera:
        queryable = camera.declare_queryable(KEY, answer)
        wait_until(lambda: list(camera.get(f"@/*/router/queryable/{KEY}")))
        monkeypatch.setattr("zv.tracker.camera_plane.Query", partial(Query, timeout_s=20.0))
        with monkeypatch.context() as patched:
            patched.setattr("zv.tracker.camera_plane.REPLY_S", 20.0)
            assert where(plane, header(epoch=5)) == (1, 0.5)
        queryable.undeclare()
        silent = threading.Event()
        queryable = camera.declare_queryable(KEY, lambda _: silent.wait(20))
        wait_until(lambda: list(camera.get(f"@/*/router/queryable/{KEY}")))
        begun_s = time.monotonic()
        assert where(plane, header(epoch=6)) == (1, 0.5)
        assert not plane._replied.is_set()
        assert time.monotonic() - begun_s >= REPLY_S
        silent.set()


def test_a_calibration_published_without_a_queryable_stays_through_later_epochs(
    plane: CameraPlane, client: zenoh.Session, monkeypatch: pytest.MonkeyPatch
):
    answers = []

    def counted(session: zenoh.Session, query: Query, done: Callable[[Replies], None]) -> None:
        send(session, query, lambda replies: (done(replies), answers.append(list(replies)))[0])

    monkeypatch.setattr("zv.tracker.camera_plane.send", counted)
    wait_for_subscriber(client, KEY)
    client.put(KEY, calibrated(0.01))
    wait_until(lambda: where(plane, header(epoch=5)) == (1, 0.5))
    for epoch, answered in ((6, 2), (7, 3)):
        plane.view(header(epoch=epoch))
        wait_until(lambda: len(answers) == answered)  # noqa: B023 - waited for here
        assert where(plane, header(epoch=epoch)) == (1, 0.5)
    assert answers == [[], [], []]


def test_a_calibration_is_decoded_by_the_loop_and_not_on_zenohs_thread(
    plane: CameraPlane, client: zenoh.Session, monkeypatch: pytest.MonkeyPatch
):
    readers = []
    read = CameraInfo.from_bytes

    def recorded(payload: bytes) -> CameraInfo:
        readers.append(threading.current_thread())
        return read(payload)

    monkeypatch.setattr(CameraInfo, "from_bytes", recorded)
    wait_for_subscriber(client, KEY)
    client.put(KEY, calibrated(0.01))
    wait_until(lambda: plane.view(header()))
    assert set(readers) == {threading.current_thread()}


def test_a_calibration_is_scaled_to_another_size_but_not_to_another_aspect_ratio(
    plane: CameraPlane, client: zenoh.Session
):
    wait_for_subscriber(client, KEY)
    client.put(KEY, calibrated(0.01))
    wait_until(lambda: plane.view(header()))
    x, y = where(plane, header(320, 240)) or (0, 0)
    assert (x, y) == pytest.approx((2.005, 1.005))
    assert plane.view(header(640, 360)) is None


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
    plane: CameraPlane, node: Node, client: zenoh.Session, payload: bytes, reason: str
):
    wait_for_subscriber(client, KEY)
    client.put(KEY, calibrated(0.01))
    wait_until(lambda: plane.view(header()))
    client.put(KEY, payload)
    wait_until(lambda: where(plane, header()) and dropped(node, reason) == 1)
    assert where(plane, header()) == (1, 0.5)
    counters = node.counters.snapshot()
    assert (counters["received"], counters["pending"]) == (1, 0)
