"""Receives the frames of one offer from shared memory, on a thread, and passes them on."""

from __future__ import annotations

import ctypes
import logging
import threading
import weakref
from collections.abc import Callable
from typing import Any

from zenoh_vision.keys import RAW_IMAGE
from zenoh_vision.shm.channel import VIEWS, Lengths, iceoryx_errors, open_channel
from zenoh_vision.shm.doorbell import Doorbell
from zenoh_vision.shm.machine import SharedMemoryError
from zenoh_vision.stream.sample import Sample

log = logging.getLogger(__name__)

WAIT_S = 0.1
CLOSE_S = 1.0


class FrameReader:
    """A thread that passes on each frame of an offer as a sample.

    Args:
        offer: Its name.
        key: The key of the samples: that of the camera's raw pixels.
        receive: Called on the thread with each sample; must be quick.

    Attributes:
        ready: Whether it receives frames that are written from now on.
        failure: Why it has ended by itself; empty if it has not.
    """

    def __init__(self, offer: str, key: str, receive: Callable[[Sample], None]) -> None:
        self.ready = False
        self.failure = ""
        self._offer = offer
        self._key = key
        self._receive = receive
        self._closed = threading.Event()
        self._lent: list[weakref.ref[Any]] = []
        self._thread = threading.Thread(target=self._run, name="shared memory", daemon=True)
        self._thread.start()

    def end(self) -> None:
        """Tell the thread to end, which it does within ``WAIT_S``. Samples stay valid."""
        self._closed.set()

    def close(self) -> None:
        """End the thread and wait for that, in bounded time."""
        self.end()
        self._thread.join(CLOSE_S)

    def _run(self) -> None:
        try:
            with iceoryx_errors():
                self._read()
        except SharedMemoryError as error:
            self.failure = str(error)
        except Exception as error:  # a thread must not end unnoticed
            log.exception("frames cannot be received through shared memory")
            self.failure = f"{type(error).__name__}: {error}"

    def _read(self) -> None:
        bell = Doorbell.open(self._offer)
        node = service = subscriber = None
        try:
            node, service = open_channel(self._offer)
            subscriber = service.subscriber_builder().create()
            self.ready = True
            while not self._closed.is_set():
                seen = bell.number
                while (sample := subscriber.receive()) is not None:
                    self._receive(self._passed_on(sample))
                    del sample
                bell.wait(seen, WAIT_S)
        finally:
            del subscriber, service, node
            bell.close()

    def _passed_on(self, sample: Any) -> Sample:
        # iceoryx2's own views of both double the time that this function takes. The lengths are
        # believed: only processes of this user can write here.
        lengths = Lengths.from_address(sample.user_header_ptr)
        pixels, attached = lengths.pixels, lengths.attachment
        memory = (ctypes.c_uint8 * (pixels + attached)).from_address(sample.payload_ptr)
        memory.sample = sample  # references to this memory keep it alive
        whole = memoryview(memory).cast("B").toreadonly()
        attachment = bytes(whole[pixels:])
        self._lent = [lent for lent in self._lent if lent() is not None]
        if len(self._lent) >= VIEWS - 1:
            return Sample(self._key, bytes(whole[:pixels]), RAW_IMAGE, attachment, shared=True)
        self._lent.append(weakref.ref(memory))
        return Sample(self._key, whole[:pixels], RAW_IMAGE, attachment, shared=True)
