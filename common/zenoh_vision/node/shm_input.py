"""A camera's frames from shared memory, as long as the camera offers them on this machine."""

from __future__ import annotations

import logging
import threading
import time
from functools import partial
from typing import Any

import zenoh

from zenoh_vision import keys
from zenoh_vision.shm.doorbell import Doorbell
from zenoh_vision.shm.machine import channel_name, machine_identity
from zenoh_vision.shm.reader import FrameReader
from zenoh_vision.stream.frame_intake import FrameIntake
from zenoh_vision.transport.link import Declaration, Link
from zenoh_vision.transport.session import direct

log = logging.getLogger(__name__)

AGAIN_S = 10.0
"""An offer that could not be taken is tried again after this time."""


class SharedMemoryInput:
    """Follows the offers of one camera, and receives its frames from the newest.

    Args:
        link: To the router.
        namespace: First chunk of the keys.
        camera: Whose frames.
        intake: Takes the samples.
        raw_key: The key of the camera's raw pixels, which the samples carry.

    Anyone can declare any number of tokens. Only tokens with a doorbell are used, since only
    processes of this user can make doorbells.

    Attributes:
        failure: Why offered frames are not received; empty if they are, or if none are offered.
    """

    def __init__(
        self, link: Link, namespace: str, camera: str, intake: FrameIntake, raw_key: str
    ) -> None:
        self.failure = ""
        self._link = link
        self._camera = camera
        self._intake = intake
        self._raw_key = raw_key
        self._pattern = keys.shared_memory_key(namespace, camera, machine_identity(), "*")
        self._offers: set[str] = set()
        self._failed_s: dict[str, float] = {}
        self._lock = threading.Lock()
        self._following: Declaration[Any] | None = None
        self._offer: str | None = None
        self._reader: FrameReader | None = None
        self._request: Declaration[Any] | None = None

    @property
    def receiving(self) -> bool:
        """Whether a camera offers its frames, and they are received."""
        return self._request is not None

    def follow(self, *, wanted: bool) -> None:
        """Open or close the connection to the newest offer, as needed; does not wait."""
        if wanted and self._following is None:
            self._following = self._link.declare(self._subscribe)
        elif not wanted and self._following is not None:
            self._following.undeclare()
            self._following = None
            with self._lock:
                self._offers.clear()
        reader = self._reader
        if reader is not None and reader.failure and self._offer is not None:
            words = f"no frames of {self._camera} through shared memory: {reader.failure}"
            if words != self.failure:
                log.warning("%s; trying again every %g s", words, AGAIN_S)
            self.failure = words
            self._failed_s[self._offer] = time.monotonic()
        newest = self._newest()
        if not self._failed_s:
            self.failure = ""
        if newest != self._offer:
            self._leave()
            self._open_reader(newest)
        if self._reader is not None and self._reader.ready and self._request is None:
            self._ask(self._offer or "")

    def close(self) -> None:
        """Stop receiving, and wait for that in bounded time."""
        reader = self._reader
        self.follow(wanted=False)
        if reader is not None:
            reader.close()

    def _newest(self) -> str | None:
        """Return the newest offer, except those that failed a short time ago."""
        now_s = time.monotonic()
        with self._lock:
            offers = set(self._offers)
        self._failed_s = {each: at for each, at in self._failed_s.items() if each in offers}
        untried = offers - self._failed_s.keys()
        again = {each for each, at in self._failed_s.items() if now_s - at > AGAIN_S}
        return max(untried, default=None) or max(again, default=None)

    def _open_reader(self, offer: str | None) -> None:
        self._offer = offer
        if offer is not None:
            name = channel_name(offer)
            self._reader = FrameReader(name, self._raw_key, self._intake.receive)

    def _ask(self, offer: str) -> None:
        """Subscribe to an offer, so that the camera writes: only once the reader can receive."""
        self.failure = ""
        self._failed_s.pop(offer, None)
        handler = direct(lambda _sample: None)
        self._request = self._link.declare(partial(_subscribe_to, offer, handler))

    def _leave(self) -> None:
        if self._request is not None:
            self._request.undeclare()
            self._request = None
        if self._reader is not None:
            self._reader.end()
            self._reader = None

    def _subscribe(self, session: zenoh.Session) -> Any:
        with self._lock:
            self._offers = set()  # of another session
        tokens = session.liveliness()
        return tokens.declare_subscriber(self._pattern, direct(self._on_token), history=True)

    def _on_token(self, sample: zenoh.Sample) -> None:
        key = str(sample.key_expr)
        with self._lock:
            if sample.kind != zenoh.SampleKind.PUT:
                self._offers.discard(key)
            elif Doorbell.exists(channel_name(key)):
                self._offers.add(key)


def _subscribe_to(key: str, handler: Any, session: zenoh.Session) -> Any:
    return session.declare_subscriber(key, handler)
