"""Receives the frames of one offer from shared memory."""

from __future__ import annotations

import ctypes
import weakref
from typing import Any, Self

from zenoh_vision.host.clock import SYSTEM_CLOCK, Clock
from zenoh_vision.keys import RAW_IMAGE
from zenoh_vision.shm.channel import VIEWS, Layout, iceoryx_errors, open_channel
from zenoh_vision.shm.doorbell import Doorbell
from zenoh_vision.stream.sample import Sample


class FrameReader:
    """Receives the frames of an offer as samples on a key; used by one thread, in a ``with``.

    Raises:
        SharedMemoryError: It cannot be opened.
    """

    def __init__(self, offer: str, key: str, clock: Clock = SYSTEM_CLOCK) -> None:
        self._key = key
        self._clock = clock
        self._lent: list[weakref.ref[Any]] = []  # of memory that something refers to
        self._bell = Doorbell.open(offer)
        self._rung = self._bell.number
        self._node: Any = None
        self._service: Any = None
        self._subscriber: Any = None
        try:
            with iceoryx_errors():
                self._node, self._service = open_channel(offer)
                self._subscriber = self._service.subscriber_builder().create()
        except BaseException:
            self.__exit__()
            raise

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_error: object) -> None:
        """Release the channel; samples that were received stay valid."""
        self._subscriber = self._service = self._node = None
        self._bell.close()

    def wake(self) -> None:
        """End a wait for a frame, from another thread."""
        self._bell.wake()

    def receive(self, timeout_s: float) -> Sample | None:
        """Return the next frame; None after the time-out. Called inside of ``iceoryx_errors``.

        Raises:
            SharedMemoryError: Nothing can be received any more.
        """
        sample = self._subscriber.receive()
        if sample is None:
            # The number was read before that look, so a frame that came since has changed it.
            self._rung = self._bell.wait(self._rung, timeout_s)
            sample = self._subscriber.receive()
        if sample is None:
            return None
        # iceoryx2's own views of both double the time that this takes. The lengths are
        # believed: only processes of this user can write here.
        layout = Layout.from_address(sample.user_header_ptr)
        length, attached = layout.payload, layout.attachment
        encoding = layout.encoding.decode("ascii")
        memory = (ctypes.c_uint8 * (length + attached)).from_address(sample.payload_ptr)
        memory.sample = sample  # references to this memory keep it alive
        whole = memoryview(memory).cast("B").toreadonly()
        attachment = bytes(whole[length:])
        if encoding != RAW_IMAGE or len(self._lent) >= VIEWS - 1:
            payload: bytes | memoryview = bytes(whole[:length])
        else:
            self._lent.append(weakref.ref(memory, self._lent.remove))
            payload = whole[:length]
        clock = self._clock
        times = clock.monotonic_ns(), clock.time_ns()
        return Sample(self._key, payload, encoding, attachment, *times, route="shm")
