"""Samples of Zenoh's: what is too large is refused before it is copied."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest
import zenoh

from zenoh_vision.image.codecs import MAX_COMPRESSED_BYTES
from zenoh_vision.keys import RAW_IMAGE
from zenoh_vision.message_codec import MAX_MESSAGE_BYTES
from zenoh_vision.stream.buffer import queue
from zenoh_vision.stream.counters import FrameCounters
from zenoh_vision.stream.frame_intake import FrameIntake
from zenoh_vision.stream.intake import Consumer, Intake, MessageIntake, SampleIntake
from zenoh_vision.transport.subscriber import subscribe

KEY = "vision/front/image"
RAW_BYTES = 7680 * 4320 * 4


class Payload:
    """A payload of any size, which cannot be copied."""

    def __init__(self, size: int) -> None:
        self._size = size
        self.copied = False

    def __len__(self) -> int:
        return self._size

    def to_bytes(self) -> bytes:
        self.copied = True
        return b""


class Router:
    """Stands for a link with one subscription, and delivers samples to it."""

    def declare(self, declare: Any) -> None:
        declare(self)

    def declare_subscriber(self, key: str, handler: Any) -> None:
        self.deliver = handler

    def send(self, payload: Payload, kind: zenoh.SampleKind = zenoh.SampleKind.PUT) -> None:
        fields = {"key_expr": KEY, "encoding": "", "attachment": None}
        self.deliver(SimpleNamespace(kind=kind, payload=payload, **fields))


@pytest.mark.parametrize(
    ("new", "max_bytes", "reason"),
    [
        pytest.param(
            lambda consumer: FrameIntake(KEY, consumer),
            MAX_COMPRESSED_BYTES,
            "too_large",
            id="compressed",
        ),
        pytest.param(
            lambda consumer: FrameIntake(KEY, consumer, encoding=RAW_IMAGE),
            RAW_BYTES,
            "too_large",
            id="raw",
        ),
        pytest.param(
            lambda consumer: MessageIntake(KEY, consumer),
            MAX_MESSAGE_BYTES,
            "bad_message",
            id="messages",
        ),
        pytest.param(
            lambda consumer: SampleIntake(KEY, consumer), RAW_BYTES, "too_large", id="samples"
        ),
    ],
)
def test_a_payload_over_the_limit_is_refused_before_it_is_copied(
    new: Any, max_bytes: int, reason: str
):
    counters, router = FrameCounters(), Router()
    intake: Intake[Any, Any] = new(Consumer(counters, lambda _: None))
    subscribe(router, intake)  # type: ignore[arg-type]
    allowed, too_large = Payload(max_bytes), Payload(max_bytes + 1)
    router.send(too_large)
    assert not too_large.copied
    assert counters.snapshot()[f"dropped.{reason}"] == 1
    router.send(allowed)
    assert allowed.copied


def test_a_deletion_arrives_as_such():
    router = Router()
    intake = SampleIntake(KEY, Consumer(FrameCounters(), lambda _: None), queue(2))
    subscribe(router, intake)  # type: ignore[arg-type]
    router.send(Payload(0), zenoh.SampleKind.DELETE)
    router.send(Payload(0))
    found = [intake.take(0), intake.take(0)]
    assert [sample is not None and sample.deleted for sample in found] == [True, False]
