"""A recorder fits behind the intake: every key of a camera into a file, and out of it again."""

from __future__ import annotations

from pathlib import Path

import msgpack

from tests.support.publishing import PlainCamera
from tests.support.waiting import in_time
from zenoh_vision import (
    Consumer,
    FrameCounters,
    FrameIntake,
    Node,
    PayloadError,
    Sample,
    queue,
)

IMAGE = "vision/front/image/compressed"


def record(node: Node, file: Path, frames: int) -> None:
    """Write every sample of every key until enough frames came."""
    with file.open("wb") as out:
        for sample in in_time(node, node.samples("vision/**", buffering=queue(500))):
            out.write(msgpack.packb([sample.key, sample.payload, sample.attachment]))
            frames -= sample.key == IMAGE
            if not frames:
                return


def replay(file: Path, intake: FrameIntake) -> None:
    """Deliver every sample of a key, as a transport does."""
    with file.open("rb") as recorded:
        for key, payload, attachment in msgpack.Unpacker(recorded):
            if key == intake.key:
                intake.receive(Sample(key, payload, attachment=attachment))


def test_what_was_recorded_gives_the_same_frames_again(connection, client, tmp_path):
    camera = PlainCamera(client)
    with Node("recorder", camera=(), connection=connection) as node, camera.at(50):
        record(node, tmp_path / "recording", frames=10)
        counted = node.counters.snapshot()
    assert counted["processed"] >= 10

    drops: list[PayloadError] = []
    intake = FrameIntake(IMAGE, Consumer(FrameCounters(), drops.append), queue(20))
    replay(tmp_path / "recording", intake)
    frames = list(iter(lambda: intake.take(0, "bgr", None), None))
    assert drops == []
    assert len(frames) == 10
    numbers = [frame.header.seq for frame in frames]
    assert numbers == list(range(numbers[0], numbers[0] + 10))
