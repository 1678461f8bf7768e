"""Cameras and streams of a few lines: plain Zenoh, OpenCV and msgpack, by the contract alone."""

from __future__ import annotations

import random
import threading
import time
from collections.abc import Callable
from typing import Any, Self

import msgpack
import numpy as np
import zenoh

from tests.support.pictures.encoded import PICTURES, size_of
from tests.support.waiting import wait_until

IMAGE_KEY = "vision/front/image/compressed"


def wait_for_subscriber(session: zenoh.Session, key: str) -> None:
    """Wait until a session knows that somebody subscribes to a key: what it puts then arrives."""
    with session.declare_publisher(key) as publisher:
        wait_until(lambda: publisher.matching_status.matching)  # type: ignore[attr-defined]


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

    def __exit__(self, *error: object) -> None:
        """Stop and wait for the call in work."""
        self._stop.set()
        self._thread.join(10)

    def _run(self) -> None:
        due_s = time.monotonic()
        while not self._stop.wait(max(0.0, due_s - time.monotonic())):
            self._call()
            self.calls += 1
            due_s += self._period_s


RAW_PIXELS = np.arange(6 * 8 * 3, dtype=np.uint8).reshape(6, 8, 3)


def raw_frames(publisher: zenoh.Publisher) -> Callable[[], None]:
    """Return what publishes frame after frame of ``RAW_PIXELS``, on the raw key of a camera."""
    epoch, numbers = time.time_ns(), iter(range(10**9))
    camera = str(publisher.key_expr).split("/")[1]

    def send() -> None:
        identity = {"camera": camera, "epoch": epoch, "seq": next(numbers)}
        shape = {"width": 8, "height": 6, "encoding": "bgr8"}
        header = {**identity, **shape, "stamp_ns": time.time_ns()}
        publisher.put(RAW_PIXELS.tobytes(), attachment=msgpack.packb(header))

    return send


S = 10**9
DAY = 24 * 3600 * S


def hostile_header(rng: random.Random, camera: PlainCamera) -> dict[str, int]:
    """Return fields of a sound header that is wrong by little or by much."""
    now_ns = time.time_ns()
    near = max(0, camera.seq + rng.randrange(-2000, 2000))
    stamps_ns = (now_ns, now_ns - DAY, now_ns + DAY - 60 * S, now_ns + rng.randrange(-S, S), 0)
    return {
        "epoch": rng.choice([camera.epoch, camera.epoch, now_ns, now_ns + rng.randrange(DAY), 1]),
        "seq": rng.choice([2**63, 2**64 - 1, 0, near]),
        "stamp_ns": rng.choice(stamps_ns),
    }


KEPT = zenoh.CongestionControl.BLOCK
"""For what a test counts: by default Zenoh drops what a busy machine does not take at once."""

JPEG = "image/jpeg"
CENTROID = "application/msgpack;vision.Centroid.v1"


def header(seq: int, **changes: Any) -> dict[str, Any]:
    return {
        "camera": "c",
        "epoch": 1_000,
        "seq": seq,
        "stamp_ns": time.time_ns(),
        "width": 64,
        "height": 48,
        "node": "camera_c",
        **changes,
    }


def put_picture(session: zenoh.Session, key: str, seq: int, **changes: Any) -> None:
    attachment = msgpack.packb(header(seq, encoding="bgr8", **changes))
    picture = b"\xff\xd8\xff" + b"x" * 997
    session.put(key, picture, encoding=JPEG, attachment=attachment, congestion_control=KEPT)


def put_centroid(session: zenoh.Session, key: str, seq: int, **changes: Any) -> None:
    head = header(seq, node="tracker_c", **changes)
    body = {"header": head, "x": seq * 10, "y": 2, "box": [1, 2, 3, 4], "area": 0.5}
    payload, attachment = msgpack.packb(body), msgpack.packb(head)
    session.put(key, payload, encoding=CENTROID, attachment=attachment, congestion_control=KEPT)


def counting(session: zenoh.Session, key: str, put: Callable = put_picture) -> Callable[[], None]:
    """Return what puts message after message on a key."""
    numbers = iter(range(10**9))
    return lambda: put(session, key, next(numbers))
