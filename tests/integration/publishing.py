"""A camera of a few lines: plain Zenoh, OpenCV and msgpack, by the contract alone."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from types import TracebackType
from typing import Any, Self

import msgpack
import zenoh

from tests.integration.pictures import PICTURES, size_of

IMAGE_KEY = "vision/front/image/compressed"


class PlainCamera:
    """Publishes JPEGs with headers, one by one or at a rate.

    Args:
        session: Of a client.
        epoch: Its run; now, if not given.
        pictures: JPEGs that are shown in turn.
        camera: Its name.
        key: Where it publishes.
        congestion_control: What happens when the way is full: by default nothing is lost.
    """

    def __init__(
        self,
        session: zenoh.Session,
        *,
        epoch: int | None = None,
        pictures: tuple[bytes, ...] = PICTURES,
        camera: str = "front",
        key: str | None = None,
        congestion_control: zenoh.CongestionControl = zenoh.CongestionControl.BLOCK,
    ) -> None:
        self.epoch = time.time_ns() if epoch is None else epoch
        self.seq = 0
        self.sent_s: dict[int, float] = {}
        self._session = session
        self._pictures = pictures
        self._camera = camera
        self._key = key or IMAGE_KEY.replace("front", camera)
        self._congestion_control = congestion_control

    def header(self, picture: bytes | None = None, **changes: Any) -> dict[str, Any]:
        """Return the header that the next picture gets."""
        width, height = size_of(self._pictures[0] if picture is None else picture)
        header = {
            "camera": self._camera,
            "epoch": self.epoch,
            "seq": self.seq,
            "stamp_ns": time.time_ns(),
            "width": width,
            "height": height,
            "encoding": "bgr8",
            "node": "plain",
            "revision": 0,
        }
        return header | changes

    def send(self, picture: bytes | None = None, **changes: Any) -> int:
        """Publish one good frame and return its number."""
        seq, picture = self.seq, picture or self._pictures[self.seq % len(self._pictures)]
        header = self.header(picture, **changes)
        self.sent_s[seq] = time.monotonic()
        self.seq += 1
        self.put(picture, msgpack.packb(header))
        return seq

    def put(self, payload: bytes, attachment: bytes | None) -> None:
        """Publish anything."""
        self._session.put(
            self._key,
            payload,
            encoding="image/jpeg",
            attachment=attachment,
            congestion_control=self._congestion_control,
        )

    def at(self, rate_hz: float, send: Callable[[], object] | None = None) -> Paced:
        """Return a context in which ``send`` is called at a rate: by default one good frame."""
        return Paced(rate_hz, send or self.send)


class Paced:
    """Calls something at a steady rate on a thread of its own while the context lasts."""

    def __init__(self, rate_hz: float, call: Callable[[], object]) -> None:
        self.calls = 0
        self._period_s = 1 / rate_hz
        self._call = call
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        """Stop and wait for the call in work."""
        self._stop.set()
        self._thread.join(10)

    def _run(self) -> None:
        due_s = time.monotonic()
        while not self._stop.wait(max(0.0, due_s - time.monotonic())):
            self._call()
            self.calls += 1
            due_s += self._period_s
