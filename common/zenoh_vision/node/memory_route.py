"""A camera's frames from shared memory, as long as the camera offers them on this machine."""

from __future__ import annotations

import logging
import threading
from contextlib import suppress
from functools import partial
from typing import Any

import zenoh

from zenoh_vision import keys
from zenoh_vision.host.clock import Clock
from zenoh_vision.node.routes import JOIN_S, Route
from zenoh_vision.shm.channel import iceoryx_errors
from zenoh_vision.shm.doorbell import Doorbell
from zenoh_vision.shm.machine import SharedMemoryError, channel_name, machine_identity
from zenoh_vision.shm.reader import FrameReader
from zenoh_vision.stream.intake import Intake
from zenoh_vision.transport.link import Declaration, Link
from zenoh_vision.transport.session import direct

log = logging.getLogger(__name__)

AGAIN_S = 10.0
"""An offer that could not be taken is tried again after this time."""

WAIT_S = 0.1
"""How long a wait for a frame may delay the change to a newer offer."""


class MemoryRoute(Route):
    """Follows the offers of one camera, and takes its frames from the newest, on a thread.

    The clock measures when an offer that failed is tried again. The key of the intake's samples is
    that of the camera's compressed frames.

    Anyone can declare any number of tokens. Only tokens with a doorbell are used, since only
    processes of this user can make doorbells.
    """

    def __init__(
        self,
        link: Link,
        namespace: str,
        camera: str,
        intake: Intake[Any, Any],
        clock: Clock,
    ) -> None:
        super().__init__(intake.key)
        self._link = link
        self._camera = camera
        self._intake = intake
        self._clock = clock
        self._pattern = keys.shared_memory_key(namespace, camera, machine_identity(), "*")
        self._offers: set[str] = set()
        self._current: str | None = None  # the newest of them, from which frames are received
        self._reader: FrameReader | None = None  # of that
        self._failed_ns: dict[str, int] = {}
        self._changed = threading.Condition()
        self._running = False
        self._receiving = False
        self._fault = ""
        self._lock = threading.Lock()  # for start and stop
        self._following: Declaration[Any] | None = None
        self._thread: threading.Thread | None = None

    @property
    def available(self) -> bool:
        """Whether the camera offers its frames now, and they are received."""
        return self._receiving

    @property
    def fault(self) -> str:
        """Why frames that are offered are not received; empty if they are."""
        return self._fault

    @property
    def awaited(self) -> str:
        """Where the first frame may come from."""
        return f"{self.key} in shared memory"

    def start(self) -> None:
        """Begin to follow the camera's offers."""
        with self._lock:
            if self._running:
                return
            self._running = True
            self._following = self._link.declare(self._follow_tokens)
            self._thread = threading.Thread(target=self._run, name="shared memory", daemon=True)
            self._thread.start()

    def stop(self) -> None:
        """Stop receiving, and wait for that in bounded time."""
        with self._lock:
            with self._changed:
                self._running = False
                self._offers.clear()
                self._failed_ns.clear()
                self._changed.notify()
                if self._reader is not None:
                    self._reader.wake()
            following, self._following = self._following, None
            if following is not None:
                following.undeclare()
            if self._thread is not None and self._thread is not threading.current_thread():
                self._thread.join(JOIN_S)

    def _run(self) -> None:
        while (offer := self._next_offer()) is not None:
            try:
                self._receive_from(offer)
            except SharedMemoryError as error:
                self._fail(offer, str(error))
            except Exception as error:  # a thread must not end unnoticed
                log.exception("frames cannot be received through shared memory")
                self._fail(offer, f"{type(error).__name__}: {error}")

    def _next_offer(self) -> str | None:
        """Wait for an offer that can be tried; None when the route was stopped."""
        with self._changed:
            while self._running:
                self._current = self._newest()
                if self._current is not None:
                    return self._current
                if not self._failed_ns:
                    self._fault = ""
                self._changed.wait(AGAIN_S if self._failed_ns else None)
        return None

    def _newest(self) -> str | None:
        """Return the newest offer, except those that failed a short time ago."""
        failed = self._failed_ns
        untried = max(self._offers - failed.keys(), default=None)
        if untried is not None or not failed:
            return untried
        before_ns = self._clock.monotonic_ns() - AGAIN_S * 1e9
        again = (key for key, at_ns in tuple(failed.items()) if at_ns <= before_ns)
        return max(again, default=None)

    def _receive_from(self, offer: str) -> None:
        """Receive the frames of an offer until it ends, or there is a newer one.

        Raises:
            SharedMemoryError: It cannot be opened, or nothing can be received any more.
        """
        with (
            iceoryx_errors(),
            FrameReader(channel_name(offer), self.key, self._clock) as reader,
        ):
            # The camera writes while someone subscribes: only once the reader can receive.
            request = self._link.declare(partial(_subscribe_to, offer))
            self._failed_ns.pop(offer, None)
            self._fault = ""
            self._set_receiving(True)
            self._reader = reader
            try:
                while self._running and self._current == offer:
                    sample = reader.receive(WAIT_S)
                    if sample is not None and self._intake.receive(sample):
                        self._noticed(sample)
                    del sample  # or its memory would be kept until the next
            finally:
                with self._changed:
                    self._reader = None
                self._set_receiving(False)
                with suppress(zenoh.ZError):  # the session is being closed
                    request.undeclare()

    def _set_receiving(self, value: bool) -> None:
        self._receiving = value
        self._noticed(None)

    def _fail(self, offer: str, why: str) -> None:
        words = f"no frames of {self._camera} through shared memory: {why}"
        if words != self._fault:
            log.warning("%s; trying again every %g s", words, AGAIN_S)
        self._fault = words
        with self._changed:
            if offer in self._offers:  # else it ended meanwhile
                self._failed_ns[offer] = self._clock.monotonic_ns()

    def _follow_tokens(self, session: zenoh.Session) -> Any:
        with self._changed:
            self._offers, self._failed_ns = set(), {}  # those were of another session
            self._current = None
        tokens = session.liveliness()
        return tokens.declare_subscriber(self._pattern, direct(self._on_token), history=True)

    def _on_token(self, sample: zenoh.Sample) -> None:
        key = str(sample.key_expr)
        with self._changed:
            if sample.kind != zenoh.SampleKind.PUT:
                self._offers.discard(key)
                self._failed_ns.pop(key, None)
            elif self._running and Doorbell.exists(channel_name(key)):
                self._offers.add(key)
            self._current = self._newest()
            self._changed.notify()


def _subscribe_to(key: str, session: zenoh.Session) -> Any:
    return session.declare_subscriber(key, direct(lambda _sample: None))
