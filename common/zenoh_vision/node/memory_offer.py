"""A camera's frames in shared memory: offered by a liveliness token, written while someone asks."""

from __future__ import annotations

import logging
import os
import threading
from contextlib import suppress
from typing import Any

import zenoh

from zenoh_vision import keys
from zenoh_vision.host.clock import Clock
from zenoh_vision.image.frame import Frame
from zenoh_vision.shm.machine import SharedMemoryError, channel_name, machine_identity
from zenoh_vision.shm.writer import FrameWriter
from zenoh_vision.transport.link import Declaration, Link
from zenoh_vision.transport.publisher import Demand

log = logging.getLogger(__name__)

AGAIN_NS = 10 * 10**9
"""After a failure the next offer is made after this time; if nobody has asked for its frames for as
long again, the failure is over."""


class MemoryOffer:
    """Offers the frames of one camera to the processes of this machine.

    The clock measures when a failure is over, and names the offers.

    Attributes:
        failure: Why the last frame that someone asked for could not be written; empty if it was,
            or if nobody asks for frames any more.
    """

    def __init__(self, link: Link, namespace: str, camera: str, clock: Clock) -> None:
        self.failure = ""
        self._clock = clock
        self._link = link
        self._namespace = namespace
        self._camera = camera
        self._writer: FrameWriter | None = None
        self._declared: list[Declaration[Any]] = []
        self._demand = Demand()
        self._again_ns = 0
        self._closed = False
        self._lock = threading.Lock()  # ``close`` and ``write`` are called by different threads
        self._make()

    def write(self, frame: Frame) -> bool:
        """Write a frame if someone takes it; withdraw the offer if that is not possible.

        Returns:
            Whether it was written.

        Raises:
            PayloadError: The picture cannot be decoded.
        """
        with self._lock:
            if self._closed:
                return False
            if self._writer is None and self._is_due():
                self._make()
            if self._writer is None:
                return False
            if not self._demand.exists:
                if self.failure and self._is_due():
                    self.failure = ""
                return False
            try:
                written = self._writer.write(frame)
            except SharedMemoryError as error:
                self._fail(error)
                return False
            if written and self.failure:
                log.info("frames of %s come through shared memory again", self._camera)
                self.failure = ""
            return written

    def _is_due(self) -> bool:
        return self._clock.monotonic_ns() >= self._again_ns

    def close(self) -> None:
        """Withdraw the offer and release the memory."""
        with self._lock:
            self._closed = True
            self._withdraw()

    def _make(self) -> None:
        offer = f"{self._clock.time_ns():016x}{os.urandom(4).hex()}"
        key = keys.shared_memory_key(self._namespace, self._camera, machine_identity(), offer)
        try:
            self._writer = FrameWriter(channel_name(key))
        except SharedMemoryError as error:
            self._fail(error)
            return
        self._again_ns = self._clock.monotonic_ns() + AGAIN_NS
        publisher = self._link.declare(
            lambda session: self._demand.of(session.declare_publisher(key)),
            self._demand.follow_newest,
        )
        token = self._link.declare(lambda session: session.liveliness().declare_token(key))
        self._declared = [publisher, token]

    def _fail(self, error: SharedMemoryError) -> None:
        words = f"no frames of {self._camera} through shared memory: {error}"
        if words != self.failure:
            log.warning("%s; consumers get JPEG; trying again every %g s", words, AGAIN_NS / 1e9)
        self.failure = words
        self._again_ns = self._clock.monotonic_ns() + AGAIN_NS
        self._withdraw()

    def _withdraw(self) -> None:
        declared, self._declared = self._declared, []
        for each in declared:
            with suppress(zenoh.ZError):  # the session is being closed
                each.undeclare()
        if self._writer is not None:
            self._writer.close()
            self._writer = None
