"""Records as a recorder gets them."""

from __future__ import annotations

import time
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import msgpack
import pytest

from zv.bag.record import Record, ZenohTime
from zv.bag.recorder.files import Files
from zv.bag.recorder.plan import Plan
from zv.bag.recording import Recording
from zv.bag.samples import LogClock
from zv.bag.writer import Writer

START_NS = 1_700_000_000_000_000_000
FRAME_NS = 33_333_333


def header(seq: int, camera: str = "front", epoch: int = START_NS, **more: object) -> bytes:
    """Return a header's bytes."""
    fields = {
        "camera": camera,
        "epoch": epoch,
        "seq": seq,
        "stamp_ns": START_NS + seq * FRAME_NS,
        "width": 4,
        "height": 2,
        "encoding": "bgr8",
        "node": f"camera_{camera}",
        "revision": 0,
    }
    return bytes(msgpack.packb({**fields, **more}))


def frame(seq: int, camera: str = "front", size: int = 1000) -> Record:
    """Return a frame of a camera; the payload only claims to be a JPEG."""
    return Record(
        key=f"vision/{camera}/image/compressed",
        payload=b"\xff\xd8" + bytes([seq % 251]) * (size - 4) + b"\xff\xd9",
        encoding="image/jpeg",
        attachment=header(seq, camera),
        timestamp=ZenohTime((1_700_000_000 << 32) + seq, "52cc5f86"),
        log_time_ns=START_NS + seq * FRAME_NS + 2_000_000,
    )


def message(seq: int, name: str = "centroid", schema: str = "vision.Centroid.v1") -> Record:
    fields = {"x": None, "y": None, "box": None, "area": None}
    attachment = header(seq, node="tracker_front")
    return Record(
        key=f"vision/front/{name}",
        payload=bytes(msgpack.packb({**fields, "header": msgpack.unpackb(attachment)})),
        encoding=f"application/msgpack;{schema}",
        attachment=attachment,
        log_time_ns=START_NS + seq * FRAME_NS + 9_000_000,
        priority=2,
    )


def arrived(record: Record, clock: LogClock) -> Record:
    return replace(record, log_time_ns=clock.now_ns())


def written(path: Path, records: list[Record], chunk_bytes: int = 5000) -> Path:
    writer = Writer(path, {"namespace": "vision"}, chunk_bytes=chunk_bytes)
    for record in records:
        writer.add(record)
    return writer.close()


def recorded(path: Path, frames: int, size: int = 1000, account_at: int | None = None) -> bytes:
    """Return a recording of many chunks, and of frames and messages by turns, as a recorder writes.

    With ``account_at`` it has an account more, after this frame.
    """
    clock = LogClock()
    state = [message(0, "camera_info", "vision.CameraInfo.v1")]
    files = Files(Plan(path), {"namespace": "vision"}, lambda: state, clock)
    files.open()
    for seq in range(frames):
        files.add(arrived(frame(seq, size=size), clock))
        files.add(arrived(message(seq), clock))
        files.tick()
        if seq == account_at:
            files._write_account()
    files.stop()
    return path.read_bytes()


class Camera:
    """Sends numbered frames to a recorder's files, in a time that the test makes."""

    def __init__(self, plan: Plan, monkeypatch: pytest.MonkeyPatch) -> None:
        self.clock = LogClock()
        self.files = Files(plan, {"namespace": "vision"}, list, self.clock)
        self.sent = 0
        self.now_s = 1000.0
        made = SimpleNamespace(monotonic=lambda: self.now_s, time_ns=time.time_ns)
        monkeypatch.setattr("zv.bag.recorder.files.time", made)

    def send(self, seconds: float = 0.0, count: int = 1) -> None:
        """Send frames, and let seconds pass."""
        for _ in range(count):
            self.files.add(arrived(frame(self.sent), self.clock))
            self.sent += 1
        self.now_s += seconds
        self.files.tick()


def numbers(recording: Recording) -> list[int]:
    """Return the numbers of the frames of a recording, each of which is what was sent."""
    found = []
    for channel, _, message in recording.messages():
        if channel.topic.strip("/") == "vision/front/image/compressed":
            picture = bytes(message.data).partition(b"\xff\xd8")[2]
            assert frame(picture[0]).payload in b"\xff\xd8" + picture
            found.append(picture[0])
    return found


def seqs_in(paths: list[Path]) -> list[int]:
    """Return the numbers of the frames of closed files, one file after the other."""
    found = []
    for path in paths:
        with Recording(path) as recording:
            assert recording.is_closed
            found += numbers(recording)
    return found
