"""Samples for an intake without a network, and a consumer whose drops can be read."""

from __future__ import annotations

from typing import Any

import numpy as np

from tests.support.headers import NOW_NS, header
from zenoh_vision.image.codecs import encode_jpeg
from zenoh_vision.stream.buffer import Buffering, latest
from zenoh_vision.stream.counters import FrameCounters
from zenoh_vision.stream.frame_intake import FrameIntake
from zenoh_vision.stream.intake import Consumer
from zenoh_vision.stream.sample import Sample

KEY = "vision/front/image/compressed"
RAW_KEY = "vision/front/image"
PIXELS = np.arange(64 * 48 * 3, dtype=np.uint32).reshape(48, 64, 3).astype(np.uint8)
JPEG = encode_jpeg(PIXELS, "bgr8", 90)
FAR_NS = 10**9


class Taker:
    """A consumer whose drops can be read."""

    def __init__(self) -> None:
        self.drops: list[str] = []
        self.counters = FrameCounters()
        self.consumer = Consumer(self.counters, lambda error: self.drops.append(error.reason))

    def frames(self, key: str = KEY, buffering: Buffering = latest, **options: Any) -> FrameIntake:
        return FrameIntake(key, self.consumer, buffering, **options)

    def counted(self) -> dict[str, int]:
        return balanced(self.counters)


def balanced(counters: FrameCounters) -> dict[str, int]:
    """Return the counts of a consumer, which balance."""
    found = counters.snapshot()
    dropped = sum(count for name, count in found.items() if name.startswith("dropped."))
    assert found["received"] == found["processed"] + dropped + found["pending"]
    return found


def sample(seq: int, payload: bytes | memoryview = JPEG, key: str = KEY, **fields: object):
    camera = key.split("/")[1]
    attachment = header(seq, camera=camera).to_bytes()
    route = "raw" if key == RAW_KEY else "jpeg"
    given: dict[str, Any] = {
        "route": route,
        "attachment": attachment,
        "arrived_ns": FAR_NS + seq,
        "received_ns": NOW_NS + seq,
    }
    return Sample(key, payload, **(given | fields))


def take(intake: FrameIntake):
    return intake.take(0, "bgr", 0.4)
