"""Scores the tracks that ``zv tracker`` publishes for the frames that ``zv camera`` publishes."""

from __future__ import annotations

import threading
import time
from pathlib import Path
from typing import Any

from benchmarks.quality.tracker.scoring import Scorer
from benchmarks.quality.tracker.sequence import Box
from benchmarks.system import System
from zenoh_vision.messages import Centroid, Tracks
from zenoh_vision.transport.session import direct

RATE_HZ = 10
START_S = 30.0
"""Longest wait for the tracker, and between two of its messages."""


class Receiver:
    """Collects confirmed boxes and the centroid's box by number of the frame, of one epoch."""

    def __init__(self) -> None:
        self.boxes: dict[int, dict[int, Box]] = {}
        self.centroids: dict[int, Box | None] = {}
        self.newest = -1
        self.arrived = threading.Event()
        self._epoch: int | None = None

    def on_tracks(self, sample: Any) -> None:
        """Take a ``Tracks`` message."""
        message = Tracks.from_bytes(sample.payload.to_bytes())
        if self._epoch is None:
            self._epoch = message.header.epoch
        if message.header.epoch != self._epoch:
            return  # the video began again
        self.boxes[message.header.seq] = {
            track.id: (*map(float, track.box),)
            for track in message.tracks
            if track.state == "confirmed"
        }
        self.newest = message.header.seq
        self.arrived.set()

    def on_centroid(self, sample: Any) -> None:
        """Take a ``Centroid`` message."""
        message = Centroid.from_bytes(sample.payload.to_bytes())
        if self._epoch in (None, message.header.epoch):
            self.centroids[message.header.seq] = message.box


def over_the_wire(path: Path, truth: dict[int, dict[int, Box]]) -> tuple[Scorer, int]:
    """Play a video through camera, router and tracker with defaults, at 10 Hz.

    Returns:
        The scores of the confirmed tracks, in which a frame that the tracker did not process
        counts with all its objects as missed; and how many frames with truth it processed.
    """
    last = max(truth)
    receiver = Receiver()
    with System() as system:
        session = system.session()
        ready = threading.Event()
        subscribers = [
            session.declare_subscriber("vision/front/tracks", direct(receiver.on_tracks)),
            session.declare_subscriber("vision/front/centroid", direct(receiver.on_centroid)),
            session.declare_subscriber(
                "@vision/diagnostics/tracker_front", direct(lambda _: ready.set())
            ),
        ]
        system.service("tracker", "tracker")
        if not ready.wait(START_S):
            raise SystemExit("the tracker did not start within 30 s")
        system.service("camera", "camera", "--source", f"{path}", "--rate", f"{RATE_HZ}")
        while receiver.newest < last and receiver.arrived.wait(START_S):
            receiver.arrived.clear()
        time.sleep(0.2)  # the centroid of the last frame may follow its tracks
        for subscriber in subscribers:
            subscriber.undeclare()
        session.close()
    scorer = Scorer()
    for index in range(last + 1):
        boxes = receiver.boxes.get(index, {})
        scorer.add(index, truth.get(index, {}), [], boxes, receiver.centroids.get(index))
    return scorer, sum(index in receiver.boxes for index in range(last + 1))
