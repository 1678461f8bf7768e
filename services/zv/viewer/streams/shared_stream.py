"""Shares one subscription per key among clients, from Zenoh's thread to the event loop."""

from __future__ import annotations

import asyncio
from abc import ABC, abstractmethod
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any, Generic, ParamSpec, TypeVar

import zenoh

from zenoh_vision.errors import PayloadError
from zenoh_vision.health.health import Health
from zenoh_vision.stream.counters import FrameCounters
from zenoh_vision.stream.intake import Consumer, Intake
from zenoh_vision.transport.link import Declaration, Link
from zenoh_vision.transport.subscriber import subscribe
from zv.viewer.discovery.network import LoopWakeup, Network
from zv.viewer.settings import ViewerSettings

RENDER_THREADS = 2

P = ParamSpec("P")
T = TypeVar("T")
IntakeT = TypeVar("IntakeT", bound=Intake[Any, Any])
OnClosed = Callable[[str], object]


@dataclass(frozen=True, slots=True)
class StreamContext:
    """The resources of all streams of a viewer: network, render threads, health, settings."""

    network: Network
    pool: ThreadPoolExecutor
    health: Health
    counters: FrameCounters
    settings: Callable[[], ViewerSettings]

    def processed(self, stamp_ns: int | None) -> None:
        """Count a sample as processed, with the latency since its frame's capture if known."""
        self.counters.finish()
        self.health.done(stamp_ns)

    def drop(self, error: PayloadError) -> None:
        """Count and log a sample that cannot be shown."""
        self.counters.drop(error.reason)
        self.health.log_drop(error)

    def run(self, function: Callable[P, T], *args: P.args, **kwargs: P.kwargs) -> asyncio.Future[T]:
        """Call a function on a thread of the pool."""
        return self.network.loop.run_in_executor(self.pool, function, *args, **kwargs)


class SharedStream(ABC, Generic[IntakeT]):
    """Subscribes to a key as long as it has clients; used on the event loop.

    ``on_closed`` is called with the key when the last client has left.
    """

    def __init__(self, context: StreamContext, key: str, on_closed: OnClosed) -> None:
        self.key = key
        self.closed = False
        self._context = context
        self._on_closed = on_closed
        self._intake: IntakeT | None = None
        self._subscription: Declaration[zenoh.Subscriber[None]] | None = None

    def open(self) -> None:
        """Subscribe, if there is a session and no subscription yet."""
        self._context.network.do(self._subscribe)

    def close(self) -> None:
        """Unsubscribe: the last client has left."""
        self.closed = True
        self._on_closed(self.key)
        self._context.network.do(lambda _: self._unsubscribe())

    @abstractmethod
    def _new_intake(self, consumer: Consumer) -> IntakeT:
        """Return the intake of the subscription."""

    @abstractmethod
    def _receive(self, intake: IntakeT) -> None:
        """Take the samples that have arrived; called on the event loop."""

    # On the network's thread

    def _subscribe(self, link: Link) -> None:
        if self.closed or self._subscription is not None:
            return
        context = self._context
        wakeup = LoopWakeup(context.network.loop, self._on_arrival)
        consumer = Consumer(context.counters, context.health.log_drop, wakeup)
        self._intake = self._new_intake(consumer)
        self._subscription = subscribe(link, self._intake)
        context.health.watch(self._intake)

    def _unsubscribe(self) -> None:
        if self._subscription is not None and self._intake is not None:
            self._context.health.unwatch(self._intake)
            self._subscription.undeclare()
            self._close_intake(self._intake)

    def _close_intake(self, intake: IntakeT) -> None:
        intake.close(unread="unwatched")

    def _on_arrival(self) -> None:
        """Take the samples that have arrived; called on the event loop."""
        if self._intake is not None and not self.closed:
            self._receive(self._intake)  # otherwise the samples are dropped with the subscription
