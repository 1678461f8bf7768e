"""Joins a picture and the results of the same frame by epoch and seq as they arrive."""

from __future__ import annotations

import time
from collections.abc import Iterable
from typing import Any

from zenoh_vision.errors import ConfigurationError, ExpectationNotMet
from zenoh_vision.keys import camera_of
from zenoh_vision.message_codec import Message
from zenoh_vision.messages import Centroid, Header, Tracks
from zenoh_vision.stream.buffer import queue, wait_for_any
from zenoh_vision.stream.counters import FrameCounters
from zenoh_vision.stream.frame_intake import FrameIntake
from zenoh_vision.stream.intake import Consumer, Intake, MessageIntake
from zenoh_vision.topics import CENTROID, TRACKS, topic_of
from zenoh_vision.transport.subscriber import subscribe
from zv.tools.shared.discovery import discover
from zv.tools.shared.session import ToolSession
from zv.tools.snapshot.picture import Picture

MAX_FRAMES = 64
"""Frames that are kept until their results arrive: two seconds at 30 Hz."""

POLL_S = 0.05

FrameId = tuple[int, int]
"""Epoch and seq."""

Result = Centroid | Tracks


class Join:
    """Collects pictures and results of one camera until some belong to the same frame.

    ``wanted`` are the classes of the results that a complete frame needs.
    """

    def __init__(self, camera: str, wanted: set[type[Message]]) -> None:
        self._camera = camera
        self._wanted = wanted
        self._pictures: dict[FrameId, Picture] = {}
        self._results: dict[FrameId, dict[type[Message], Result]] = {}

    def add(self, header: Header, part: Picture | Result) -> None:
        """Add a picture or a result."""
        if header.camera != self._camera:
            return
        frame = header.epoch, header.seq
        if isinstance(part, Picture):
            self._pictures[frame] = part
        else:
            self._results.setdefault(frame, {})[type(part)] = part
        for parts in (self._pictures, self._results):
            if len(parts) > MAX_FRAMES:
                del parts[next(iter(parts))]

    def receive(self, pictures: FrameIntake, results: Iterable[MessageIntake]) -> None:
        """Add the pictures and results that have arrived."""
        while (arrival := pictures.buffer.take(0)) is not None:
            if frame := pictures.accept(arrival, None):
                self.add(frame.header, Picture(arrival.sample, arrival.form, frame))
        for intake in results:
            while intake.buffer.filled:
                message = intake.take(0)
                if isinstance(message, Result):
                    self.add(message.header, message)

    def newest(self, *, complete: bool = True) -> tuple[Picture, Result] | None:
        """Return the newest picture with its tracks, or else its centroid.

        With ``complete`` only if all wanted results of its frame have arrived.
        """
        wanted = self._wanted if complete else set()
        for frame in sorted(self._pictures, reverse=True):
            results = self._results.get(frame)
            if results and wanted <= results.keys():
                return self._pictures[frame], results.get(Tracks) or results[Centroid]
        return None


def join(
    session: ToolSession, key: str, patience_s: float
) -> tuple[Picture, Result] | tuple[None, None]:
    """Return the first picture of a key whose results arrived, with its result; None if stopped.

    Raises:
        ConfigurationError: The key is not that of the pictures of one camera.
        ExpectationNotMet: No picture and result of the same frame arrived.
    """
    topic = topic_of(key)
    if topic is None or "*" in key:
        raise ConfigurationError(f"--draw: {key} is not a key of one camera in the topic table")
    found = discover(session)
    namespace, camera = key.split("/")[0], camera_of(key)
    keys = {each: each.key(namespace, camera) for each in (CENTROID, TRACKS)}
    published = [each for each, result in keys.items() if found.keys(result)]
    if not published:
        raise ExpectationNotMet(
            f"--draw: nobody publishes {' or '.join(keys.values())}; is a tracker running?"
        )
    joined = Join(camera, {each.message for each in published if each.message})
    # Skip a damaged sample: the next one may be valid.
    consumer = Consumer(FrameCounters(), dropped=lambda _: None)
    pictures = FrameIntake(key, consumer, queue(MAX_FRAMES), encoding=topic.encoding)
    results = [
        MessageIntake(result, consumer, queue(MAX_FRAMES), message=each.message)
        for each, result in keys.items()
    ]
    intakes: list[Intake[Any, Any]] = [pictures, *results]
    for intake in intakes:
        subscribe(session.link, intake)
    end_s = time.monotonic() + patience_s
    while (pair := joined.newest()) is None and time.monotonic() < end_s:
        if session.stopping:
            return None, None
        wait_for_any(consumer.filled, [intake.buffer for intake in intakes], POLL_S)
        joined.receive(pictures, results)
    pair = pair or joined.newest(complete=False)
    if pair is None:
        raise ExpectationNotMet(
            f"--draw: no picture on {key} and {' or '.join(each.name for each in published)} "
            f"of the same frame within {patience_s:g} s"
        )
    return pair
