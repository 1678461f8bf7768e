"""Two cameras in one loop, paired by their stamps, over a real router."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager

import pytest
import zenoh

from tests.support.library import LampSettings
from tests.support.listening import balance
from tests.support.publishing import PlainCamera, put_centroid, wait_for_subscriber
from tests.support.waiting import POLL_S, in_time
from zenoh_vision import Centroid, Frame, Node, queue

PERIOD_NS = 33_333_333


@pytest.fixture
def node(connection) -> Iterator[Node]:
    """A node of two cameras, with parameters."""
    with Node(
        "stereo",
        camera=("left", "right"),
        connection=connection,
        parameters=LampSettings(),
    ) as node:
        yield node


@pytest.fixture
def rig(client) -> Rig:
    return Rig(client)


class Rig:
    """Two cameras that are triggered together; one may be off."""

    def __init__(self, session: zenoh.Session) -> None:
        self.session = session
        self.cameras = {name: PlainCamera(session, camera=name) for name in ("left", "right")}
        self.off: set[str] = set()
        self.last_ns = 0

    def trigger(self) -> None:
        # A busy machine makes up for late triggers by several at once; their stamps do not.
        now_ns = self.last_ns = max(time.time_ns(), self.last_ns + PERIOD_NS)
        for name, camera in self.cameras.items():
            if name in self.off:
                camera.seq += 1
            else:
                camera.send(stamp_ns=now_ns + (3_000_000 if name == "right" else 0))

    def running(self, node: Node) -> ExitStack:
        """Trigger 30 times a second from when the node has subscribed until the context ends."""
        for name in self.cameras:
            wait_for_subscriber(self.session, f"vision/{name}/image/compressed")
        running = ExitStack()
        running.enter_context(self.cameras["left"].at(30, self.trigger))
        return running


@contextmanager
def stopping_after(node: Node, reason: str, count: int) -> Iterator[None]:
    """Stop the node when so many items were dropped for a reason."""

    def watch() -> None:
        while node.counters.snapshot().get(f"dropped.{reason}", 0) < count and not node.stopping:
            time.sleep(POLL_S)
        node.stop()

    thread = threading.Thread(target=watch, daemon=True)
    thread.start()
    yield
    thread.join()


def inputs_of(node: Node):
    return [
        node.frames(camera=name, want="gray", max_age_s=None, buffering=queue(100))
        for name in ("left", "right")
    ]


def test_frames_that_were_taken_together_come_together_with_one_revision(node: Node, rig: Rig):
    inputs = inputs_of(node)
    with rig.running(node):
        seen = []
        for left, right in in_time(node, node.pairs(*inputs, tolerance_s=0.015)):
            assert (left.header.camera, right.header.camera) == ("left", "right")
            assert right.header.stamp_ns - left.header.stamp_ns == 3_000_000
            assert left.revision is right.revision is node.parameters.active
            node.parameters.change({"power": len(seen)})
            seen.append(left.header.seq)
            assert left.header.seq == right.header.seq
            if len(seen) == 10:
                break
    assert seen == sorted(set(seen))
    counted = node.counters.snapshot()
    assert counted["processed"] == 20
    assert balance(counted) == 0
    assert counted["pending"] == 0


def test_frames_without_a_partner_are_counted_and_do_not_wait_for_ever(node: Node, rig: Rig):
    rig.off = {"right"}
    inputs = inputs_of(node)

    with rig.running(node), stopping_after(node, "unpaired", 5):
        assert list(in_time(node, node.pairs(*inputs, wait_s=0.1))) == []
    counted = node.counters.snapshot()
    assert counted["dropped.unpaired"] >= 5
    assert counted["processed"] == 0
    assert balance(counted) == 0


def test_a_frame_and_the_result_made_from_it_are_a_pair_without_tolerance(connection, client):
    with Node("judge", camera="c", connection=connection) as node:
        frames = node.frames(want="gray", max_age_s=None, buffering=queue(9))
        centroids = node.messages("centroid")
        camera = PlainCamera(client, camera="c")
        wait_for_subscriber(client, "vision/c/image/compressed")
        wait_for_subscriber(client, "vision/c/centroid")
        for seq in range(3):
            stamp_ns = time.time_ns()
            camera.send(stamp_ns=stamp_ns)
            put_centroid(client, "vision/c/centroid", seq, stamp_ns=stamp_ns)
        found = []
        for frame, centroid in in_time(node, node.pairs(frames, centroids, tolerance_s=0)):
            assert isinstance(frame, Frame)
            assert isinstance(centroid, Centroid)
            found.append((frame.header.seq, centroid.x))
            if len(found) == 3:
                break
    assert found == [(0, 0), (1, 10), (2, 20)]


def test_what_carries_no_header_is_dropped_and_counted(node: Node, client):
    frames = node.frames(camera="left", want="gray")
    diagnostics = node.messages("@vision/diagnostics/*")
    with stopping_after(node, "no_header", 1):
        assert list(in_time(node, node.pairs(frames, diagnostics, wait_s=0))) == []
    assert node.counters.snapshot()["dropped.no_header"] >= 1


def test_wrong_arguments_are_explained(node: Node):
    left, right = inputs_of(node)
    with pytest.raises(ValueError, match="two different inputs"):
        node.pairs(left, left)
    with pytest.raises(ValueError, match="depth at least 1"):
        node.pairs(left, right, depth=0)
    left.close()
    with pytest.raises(RuntimeError, match="is closed"):
        next(node.pairs(left, right))
