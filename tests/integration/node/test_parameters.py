"""Parameters of services that run: in force between two frames, all or none, in the headers."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Any

import cv2
import msgpack
import numpy as np
import pytest
import zenoh

from tests.integration.conftest import a_router, some_services
from tests.support.listening import Listener, Message, message_of, open_client, wait_for_nodes
from tests.support.pictures.encoded import HEIGHT, PICTURES, STILL, WIDTH
from tests.support.publishing import PlainCamera
from tests.support.waiting import wait_until
from zv.camera.synthetic.scene import Scene

SIZE = (160, 120)
CAMERA = "@vision/param/camera_front"
EDGE = "@vision/param/edge_front"
QUIET = ("--width", SIZE[0], "--height", SIZE[1], "--noise", 0, "--rate", 25)


@dataclass
class Answer:
    """The reply to one query: its message, or what was refused."""

    body: dict[str, Any] = field(default_factory=dict)
    refusal: dict[str, str] = field(default_factory=dict)


class System:
    """A camera with tracker and edge detector, and a tracker of a camera of the tests' own."""

    def __init__(self, client: zenoh.Session, another: zenoh.Session) -> None:
        self.client = client
        self.another = another

    def ask(self, key: str, *value: object, session: zenoh.Session | None = None) -> Answer:
        """Read a parameter or all of a node; or set with a value."""
        payload = msgpack.packb(value[0]) if value else None
        return self.ask_with(key, payload, session)

    def ask_with(
        self, key: str, payload: bytes | None, session: zenoh.Session | None = None
    ) -> Answer:
        if payload is not None:
            key = key.replace("/param/", "/set/")
        (reply,) = (session or self.client).get(key, payload=payload, timeout=10.0)
        if reply.ok is not None:
            return Answer(body=message_of(reply.ok).body)
        assert str(reply.err.encoding) == "application/msgpack;vision.Refusal.v1"
        return Answer(refusal=msgpack.unpackb(reply.err.payload.to_bytes()))

    def set(self, key: str, value: object) -> int:
        """Set, and return the new revision."""
        answer = self.ask(key, value)
        assert not answer.refusal
        return int(answer.body["revision"])

    def values(self, key: str) -> dict[str, Any]:
        return {one["name"]: one["value"] for one in self.ask(key).body["parameters"]}


@pytest.fixture(scope="module")
def system(tmp_path_factory: pytest.TempPathFactory) -> Iterator[System]:
    folder = tmp_path_factory.mktemp("parameters")
    with (
        a_router(folder) as router,
        some_services(router.endpoint, folder) as start,
        open_client(router.endpoint) as client,
        open_client(router.endpoint) as another,
    ):
        start("camera", *QUIET)
        start("tracker", "--pipeline", "tutorial")
        start("edge")
        start("tracker", "--camera", "own", "--pipeline", "tutorial", "--no-detect-shadows")
        wait_for_nodes(client, "camera_front", "tracker_front", "edge_front", "tracker_own")
        yield System(client, another)


@pytest.fixture
def images(system: System) -> Iterator[Listener]:
    listener = Listener(system.client, "vision/front/image/compressed")
    listener.wait_for(2)
    yield listener
    listener.close()


def from_revision(listener: Listener, revision: int, count: int = 3) -> list[Message]:
    """Return all messages so far, once there are so many of a revision."""

    def enough() -> bool:
        found = [m for m in listener.messages if m.header["revision"] >= revision]
        return len(found) >= count

    wait_until(enough, 15, lambda: f"{[m.header['revision'] for m in listener.messages]}")
    return listener.messages


def epochs(messages: list[Message]) -> set[int]:
    return {message.header["epoch"] for message in messages}


def is_flipped(picture: Message) -> bool:
    """Tell by the room, whose picture without noise is known, whether it is mirrored."""
    bgr = cv2.imdecode(np.frombuffer(picture.payload, np.uint8), cv2.IMREAD_COLOR)
    room = Scene(*SIZE, seed=1).background().astype(int)
    off = [float(np.median(np.abs(bgr - one))) for one in (room, room[:, ::-1])]
    assert min(off) * 3 < max(off), off
    return off[1] < off[0]


def is_lit(picture: Message) -> bool:
    """Tell by the room, a third brighter than it is known to be."""
    bgr = cv2.imdecode(np.frombuffer(picture.payload, np.uint8), cv2.IMREAD_COLOR)
    room = Scene(*SIZE, seed=1).background()
    return float(bgr.mean()) > 1.15 * float(room.mean())


def test_a_change_is_in_every_frame_of_its_revision_and_in_none_before(system, images):
    revisions = {}
    for flip in ("horizontal", "none", "horizontal", "none"):
        revisions[system.set(f"{CAMERA}/flip", flip)] = flip == "horizontal"
        from_revision(images, max(revisions), 2)
    seen = [m for m in images.messages if m.header["revision"] in revisions]
    assert {m.header["revision"] for m in seen} == set(revisions)
    wrong = [m.header for m in seen if is_flipped(m) != revisions[m.header["revision"]]]
    assert wrong == []
    assert len(epochs(images.messages)) == 1
    numbers = [(m.header["seq"], m.header["revision"]) for m in images.messages]
    assert numbers == sorted(numbers)


def test_the_truth_is_mirrored_with_the_picture_of_the_same_frame(system, images):
    truth = Listener(system.client, "vision/front/truth")
    start = max(m.header["seq"] for m in images.messages)
    scene = Scene(*SIZE, rate_hz=25.0, seed=1, noise=0.0)
    revision = system.set(f"{CAMERA}/flip", "horizontal")
    messages = from_revision(truth, revision, 3)
    system.set(f"{CAMERA}/flip", "none")
    compared = 0
    for message in messages:
        header = message.header
        if header["seq"] <= start:
            continue
        for told, known in zip(message.body["tracks"], scene.truth(header["seq"]), strict=True):
            left, top, width, height = known.box
            expected = SIZE[0] - left - width if header["revision"] == revision else left
            assert told["box"] == [expected, top, width, height]
            compared += header["revision"] == revision
    assert compared
    truth.close()


@pytest.mark.parametrize(
    ("name", "value", "holds"),
    [
        ("quality", 20, lambda m: len(m.payload) < 3000),
        ("encoding", "mono16", lambda m: m.encoding == "image/png"),
        ("faults", "lighting@now+100000", lambda m: is_lit(m)),
        ("rate", 50.0, lambda m: True),
        ("objects", 1, lambda m: True),
    ],
)
def test_a_camera_goes_on_in_its_epoch_where_it_can(
    system, images, name: str, value: object, holds: Callable[[Message], bool]
):
    before = system.values(CAMERA)[name]
    epoch = images.messages[-1].header["epoch"]
    revision = system.set(f"{CAMERA}/{name}", value)
    found = [m for m in from_revision(images, revision) if m.header["revision"] == revision]
    assert all(holds(message) for message in found)
    assert epochs(found) == {epoch}
    revision = system.set(f"{CAMERA}/{name}", before)
    after = [m for m in from_revision(images, revision) if m.header["revision"] == revision]
    assert epochs(after) == {epoch}


def test_another_size_is_another_epoch_and_every_picture_has_the_size_of_its_revision(
    system, images
):
    first = images.messages[-1].header["epoch"]
    revision = system.set(CAMERA, {"width": 96, "height": 64})
    from_revision(images, revision)
    back = system.set(CAMERA, {"width": SIZE[0], "height": SIZE[1]})
    for message in from_revision(images, back):
        header = message.header
        expected = (96, 64) if header["revision"] == revision else SIZE
        assert (header["width"], header["height"]) == expected
        assert (header["epoch"] == first) == (header["revision"] < revision)


def test_what_is_set_on_an_edge_detector_is_in_its_next_frames(system):
    edges = Listener(system.client, "vision/front/edges/compressed")
    edges.wait_for(1)
    revision = system.set(EDGE, {"format": "jpeg", "low": 0.0, "high": 0.0, "sigma": 0.0})
    messages = from_revision(edges, revision)
    assert {m.encoding for m in messages if m.header["revision"] < revision} <= {"image/png"}
    assert {m.encoding for m in messages if m.header["revision"] == revision} == {"image/jpeg"}
    system.set(EDGE, {"format": "png", "low": 40.0, "high": 100.0})
    edges.close()


def test_a_tracker_keeps_its_background_whatever_is_set(system):
    """Without shadows the first frame of a new background would be all foreground."""
    centroids = Listener(system.client, "vision/own/centroid")
    camera = PlainCamera(system.client, pictures=(STILL,), camera="own")
    with camera.at(30):
        wait_until(lambda: len(centroids.messages) > 5 and not centroids.messages[-1].body["box"])
        settled_s = centroids.messages[-1].at_s
        for name, value in {
            "history": 20,
            "var_threshold": 9.0,
            "closing": 3,
            "median": 3,
            "threshold": 100,
            "pipeline": "tutorial",
        }.items():
            system.set(f"@vision/param/tracker_own/{name}", value)
        revision = system.set("@vision/param/tracker_own/quality", 30)
        from_revision(centroids, revision)
    assert {tuple(m.body["box"] or ()) for m in centroids.since(settled_s)} == {()}
    moving = PlainCamera(system.client, pictures=PICTURES, camera="own")
    with moving.at(30):  # a new epoch is a new background, as ever
        first = wait_until(
            lambda: [m for m in centroids.messages if m.header["epoch"] == moving.epoch]
        )[0]
    assert first.body["box"] == [0, 0, WIDTH, HEIGHT]
    centroids.close()


@pytest.mark.parametrize(
    ("key", "payload", "error"),
    {
        "huge": (f"{CAMERA}/faults", msgpack.packb("x" * 8_000_000), "a payload of 8000005 bytes"),
        "no msgpack": (f"{CAMERA}/quality", b"\xc1\x00", "not msgpack"),
        "unknown": (f"{CAMERA}/qualty", msgpack.packb(5), "did you mean 'quality'?"),
        "not live": (CAMERA, msgpack.packb({"source": "/etc/passwd"}), "source cannot change"),
        "a wildcard": (f"{CAMERA}/*", msgpack.packb(5), "without *"),
    }.values(),
)
def test_bad_input_is_refused_with_the_reason_and_pictures_go_on(
    system, images, key: str, payload: bytes, error: str
):
    before = system.ask(CAMERA).body
    answer = system.ask_with(key, payload)
    assert error in answer.refusal["error"]
    assert answer.refusal["allowed"]
    assert system.ask(CAMERA).body == before
    images.wait_for(2, after_s=images.messages[-1].at_s)
