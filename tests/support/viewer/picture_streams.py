"""A stream of pictures whose frames come when a test says so, without a network."""

import asyncio
import threading
import time
from concurrent.futures import ThreadPoolExecutor

import numpy as np

from tests.support.headers import header
from tests.support.intakes import balanced
from tests.support.waiting import DEADLINE_S
from zenoh_vision.health.health import Health
from zenoh_vision.image import codecs
from zenoh_vision.image.forms import JPEG_FORM
from zenoh_vision.image.frame import Frame
from zenoh_vision.stream.buffer import Buffer, latest
from zenoh_vision.stream.counters import FrameCounters
from zenoh_vision.stream.epoch_gate import EpochGate
from zenoh_vision.stream.frame_intake import Arrival, KeyStream
from zenoh_vision.stream.sample import Sample
from zv.viewer.settings import ViewerSettings
from zv.viewer.streams.picture_stream import PictureStream
from zv.viewer.streams.rendering import RenderOptions
from zv.viewer.streams.shared_stream import StreamContext

KEY = "vision/front/image/compressed"
JPEG = codecs.encode_jpeg(np.zeros((48, 64, 3), np.uint8), "bgr8", 80)
SMALL = RenderOptions(32, 24)


class NoNetwork:
    """A network that nothing is sent to."""

    loop = property(lambda _: asyncio.get_running_loop())

    def do(self, work: object) -> None:
        pass


class Registry:
    """The context of a stream, with counters of its own; knows which streams were closed."""

    def __init__(self) -> None:
        self.counters = FrameCounters()
        self.pool = ThreadPoolExecutor(2)
        self.closed: list[str] = []
        self.context = StreamContext(
            NoNetwork(),  # type: ignore[arg-type]
            self.pool,
            Health("viewer", self.counters),
            self.counters,
            ViewerSettings,
        )


class Source:
    """A stream whose frames come when the test says so, and an intake that accepts them all."""

    def __init__(self, registry: Registry) -> None:
        self.stream = PictureStream(registry.context, KEY, registry.closed.append)
        self.stream._intake = self  # type: ignore[assignment]
        self.number = 0
        self.believe = threading.Event()  # unverified epochs wait for it
        self.believe.set()
        self.accepted: list[tuple[int, str]] = []
        self.closed = False
        self._counters = registry.counters
        self.buffer = Buffer[Arrival](latest, lambda _: registry.counters.drop("overwritten"))

    def accept(self, arrival: Arrival, max_age_s: float) -> Frame:
        payload = bytes(arrival.sample.payload)
        self.accepted.append((arrival.number, threading.current_thread().name))
        if arrival.unverified:
            assert self.believe.wait(DEADLINE_S)
        if payload == b"unforeseen":
            raise MemoryError
        return Frame(arrival.header, payload, key=KEY)

    def close(self, unread: str) -> None:
        self.closed = True

    def comes(self, payload: bytes = JPEG, missed: int = 0, unverified: bool = False) -> None:
        self.number += 1
        sent = header(self.number, stamp_ns=time.time_ns())
        stream = KeyStream(EpochGate("front"))
        arrival = Arrival(
            Sample(KEY, payload), JPEG_FORM, stream, sent, None, unverified, self.number, missed
        )
        self._counters.arrive()
        self.buffer.put(arrival, KEY, unverified=unverified)
        self.stream._on_arrival()


def balance(registry: Registry) -> dict[str, int]:
    return balanced(registry.counters)
