"""Takes the packets of a live source from the network as they come, on a thread of its own."""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Final, Generic, Protocol, TypeVar

from zenoh_vision.host import abandoned_threads

MAX_WAITING_BYTES: Final = 64 << 20
"""Most bytes that wait for the decoder. At the limit, those up to the newest key picture go."""


BURST_S: Final = 0.01
"""Longest time between two packets that the network held back and then delivers."""
MAX_BURST_S: Final = 0.2


class Packet(Protocol):
    """An undecoded picture, or a part of one."""

    @property
    def size(self) -> int:
        """Bytes."""

    @property
    def is_keyframe(self) -> bool:
        """Whether it can be decoded without those before it."""


P = TypeVar("P", bound=Packet)


@dataclass(frozen=True, slots=True)
class Arrival(Generic[P]):
    """A packet, and the monotonic time at which it came."""

    packet: P
    arrived_s: float


class PacketQueue(Generic[P]):
    """Packets in the order of their arrival, each with its time.

    They are received at once, however long decoding takes: so the time is that of the arrival, and
    it is known which are the newest.

    Args:
        packets: Blocks until the next packet; ends with the stream.
        close: Releases the connection; called on the thread that received, after it has ended.
        arrive: Called with each packet and its time, on that thread.
        interrupt: Ends a call of ``packets`` that blocks, if that is possible.
    """

    def __init__(
        self,
        packets: Iterator[P],
        close: Callable[[], None],
        arrive: Callable[[P, float], None] = lambda _packet, _arrived_s: None,
        interrupt: Callable[[], None] = lambda: None,
    ) -> None:
        self._packets = packets
        self._close = close
        self._arrive = arrive
        self._interrupt = interrupt
        self._waiting: deque[Arrival[P]] = deque()
        self._bytes = 0
        self._came = 0
        self._overflown = 0
        self._needs_key = False
        self._ended = False
        self._closing = threading.Event()
        self._error: Exception | None = None
        self._changed = threading.Condition()
        self._thread = threading.Thread(target=self._receive, name="packets", daemon=True)
        abandoned_threads.abandon(self._thread)
        self._thread.start()

    def take(self, timeout_s: float | None) -> Arrival[P] | None:
        """Return the oldest packet, as soon as there is one; None at the end of the stream.

        Raises:
            TimeoutError: None came in time.
            Exception: What receiving failed with, once all packets before are taken.
        """
        with self._changed:
            if not self._changed.wait_for(lambda: self._waiting or self._ended, timeout_s):
                raise TimeoutError
            if self._waiting:
                return self._popped()
            if self._error is not None:
                raise self._error
            return None

    def settle(self) -> None:
        """Wait until what the network held back has come: it comes at once after a pause."""
        end_s = time.monotonic() + MAX_BURST_S
        with self._changed:
            count = -1
            while count != self._came and time.monotonic() < end_s and not self._ended:
                count = self._came
                self._changed.wait(BURST_S)

    def skip_to_newest_key(self) -> int | None:
        """Drop the packets before the newest key picture; None if no key picture waits.

        Returns:
            The number of dropped packets.
        """
        with self._changed:
            if not any(each.packet.is_keyframe for each in self._waiting):
                return None
            before = len(self._waiting)
            self._keep_newest_key()
            return before - len(self._waiting)

    def taken_overflow(self) -> int:
        """Return how many packets were dropped for want of memory since the last call."""
        with self._changed:
            count, self._overflown = self._overflown, 0
            return count

    def close(self, timeout_s: float) -> None:
        """Stop receiving; waits up to a time for the connection to be closed."""
        with self._changed:
            self._closing.set()
            self._waiting.clear()
            self._bytes = 0
        self._interrupt()
        self._thread.join(timeout_s)

    def _receive(self) -> None:
        try:
            for packet in self._packets:
                arrived_s = time.monotonic()
                self._arrive(packet, arrived_s)
                with self._changed:
                    if self._closing.is_set():
                        return
                    self._came += 1
                    self._put(Arrival(packet, arrived_s))
                    self._changed.notify()
        except Exception as error:  # raised again by ``take``, on the reading thread
            self._error = error
        finally:
            with self._changed:
                self._ended = True
                self._changed.notify()
            self._closing.wait()  # packets that wait may need the container
            self._close()

    def _put(self, arrival: Arrival[P]) -> None:
        if self._needs_key and not arrival.packet.is_keyframe:
            self._overflown += 1
            return
        self._needs_key = False
        self._waiting.append(arrival)
        self._bytes += arrival.packet.size
        if self._bytes > MAX_WAITING_BYTES:
            before = len(self._waiting)
            self._keep_newest_key()
            if len(self._waiting) == before or self._bytes > MAX_WAITING_BYTES:
                self._waiting.clear()
                self._bytes = 0
                self._needs_key = True
            self._overflown += before - len(self._waiting)

    def _keep_newest_key(self) -> None:
        keys = [n for n, each in enumerate(self._waiting) if each.packet.is_keyframe]
        for _ in range(keys[-1] if keys else 0):
            self._popped()

    def _popped(self) -> Arrival[P]:
        arrival = self._waiting.popleft()
        self._bytes -= arrival.packet.size
        return arrival
