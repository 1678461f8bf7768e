"""A thread that reads an offer of shared memory, as the route of an input does."""

from __future__ import annotations

import threading
from collections.abc import Callable

from zenoh_vision.shm.reader import FrameReader
from zenoh_vision.stream.sample import Sample


class Reading:
    """Passes on each frame of an offer until it is closed; returns when it can receive."""

    def __init__(self, offer: str, receive: Callable[[Sample], None]) -> None:
        self._closed = False
        ready = threading.Event()

        def read() -> None:
            with FrameReader(offer, "vision/front/image") as reader:
                ready.set()
                while not self._closed:
                    sample = reader.receive(0.02)
                    if sample is not None:
                        receive(sample)
                    del sample  # or it would be kept until the next

        self._thread = threading.Thread(target=read, daemon=True)
        self._thread.start()
        assert ready.wait(20)

    def close(self) -> None:
        self._closed = True
        self._thread.join(20)
