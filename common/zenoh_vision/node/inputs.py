"""The inputs of a node: iterables of the items that arrive on a key, alone or several at once."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator, Sequence
from typing import Any, Generic, Protocol, TypeVar

from zenoh_vision.image.frame import Frame
from zenoh_vision.messages import Stamped
from zenoh_vision.node.core import Core
from zenoh_vision.stream.buffer import wait_for_any
from zenoh_vision.stream.intake import InputState, Intake
from zenoh_vision.transport.subscriber import subscribe

POLL_S = 0.1

T = TypeVar("T", covariant=True)


class Subscription(Protocol):
    """Passes samples to an intake until it is undeclared."""

    def undeclare(self) -> None:
        """End the subscription."""


class Input(Generic[T]):
    """The items that arrive on a key or key expression: an iterable that ends when the node stops.

    It subscribes when it is made, and unsubscribes when its loop ends, also by ``break``, at
    ``close``, or with the node; so an input can be iterated once. The time that the loop spends on
    an item is measured, and the item counted as processed, when it asks for the next. Silence on an
    input of frames is part of the node's health.

    Without a subscription, it subscribes to the intake's key.

    Attributes:
        closed: Whether it has unsubscribed for good.
    """

    def __init__(
        self,
        core: Core,
        intake: Intake[Any, T],
        subscription: Subscription | None = None,
    ) -> None:
        self.intake = intake
        self.closed = False
        self._core = core
        self._subscription = subscription or subscribe(core.link, intake)
        core.health.watch(self)
        core.inputs.add(self)

    def __iter__(self) -> Iterator[T]:
        """Yield the items that arrive until the node is told to stop, or the input is closed.

        Raises:
            RuntimeError: The input is closed, since a loop over it has ended.
        """
        return merged(self._core, (self,))

    @property
    def keys(self) -> tuple[str, ...]:
        """The key expressions that it subscribes to now."""
        return self.intake.keys

    @property
    def fault(self) -> str:
        """Why its items do not come as they should; empty if they do."""
        return self.intake.fault

    def states(self) -> Sequence[InputState]:
        """Return the state of each key whose silence is a fault."""
        return self.intake.states()

    def take(self, timeout_s: float) -> T | None:
        """Return the next item; None after the time-out in seconds, or if it was dropped.

        For a loop of one's own: call ``done`` with each item, and ``close`` at the end.
        """
        return None if self.closed else self.intake.take(timeout_s)

    def done(self, item: object) -> None:
        """Count an item as processed, with the time since its capture if it has a header."""
        count_processed(self._core, item)
        stamp_ns = item.header.age_start_ns if isinstance(item, Frame | Stamped) else None
        self._core.health.done(stamp_ns)

    def close(self) -> None:
        """Unsubscribe and drop the items that wait as ``unread``; its loop ends.

        Safe to call twice and from any thread. While the node stops, items that wait stay pending
        in its counters.
        """
        if self.closed:
            return
        self.closed = True
        self._core.inputs.discard(self)
        self._core.health.unwatch(self)
        try:
            self._subscription.undeclare()
        finally:
            self.intake.close(unread=None if self._core.stopping else "unread")


def count_processed(core: Core, item: object) -> None:
    """Count an item as processed."""
    core.counters.finish()
    if isinstance(item, Frame) and item.picture.has_padding:
        core.counters.note("padded")


def check_open(core: Core, inputs: Sequence[Input[Any]]) -> None:
    """Check that a loop over inputs can begin.

    Raises:
        RuntimeError: One is closed, and the node is not stopping.
    """
    for each in inputs:
        if each.closed and not core.stopping:
            raise RuntimeError(
                f"the input on {each.intake.key} is closed, as every input is when its loop ends; "
                "open another with node.frames, node.messages or node.samples"
            )


def merged(core: Core, inputs: Sequence[Input[Any]], every_s: float | None = None) -> Iterator[Any]:
    """Yield the items of a node's inputs until it is told to stop, or all of them are closed.

    The inputs are served in turn, so that a fast one does not starve the others. The newest
    revision of the node's parameters is activated before each item.

    With ``every_s``, None is yielded in this interval too, whether items arrive or not.

    Raises:
        RuntimeError: An input is closed, as a loop over it has ended.
    """
    check_open(core, inputs)
    buffers = [each.intake.buffer for each in inputs]
    clock, parameters = core.clock, core.parameters
    due_ns = clock.monotonic_ns() + int((every_s or 0) * 1e9)
    try:
        while not core.stopping and not core.inputs.isdisjoint(inputs):  # one is open
            core.health.loop_alive()
            if every_s is not None and clock.monotonic_ns() >= due_ns:
                due_ns = clock.monotonic_ns() + int(every_s * 1e9)
                yield None
            wait_for_any(core.consumer.filled, buffers, POLL_S)
            for each in inputs:
                if core.stopping:
                    break
                if parameters is not None:
                    parameters.activate()
                item = each.take(0.0)
                if item is None:
                    continue
                core.take_dropped()  # of none that was handed out
                try:
                    yield item
                finally:
                    if not core.take_dropped():
                        each.done(item)
    finally:
        for each in inputs:
            each.close()


def arrivals(
    core: Core, inputs: Sequence[Input[Any]], is_due: Callable[[], object]
) -> Iterator[tuple[Input[Any], Any] | None]:
    """Yield the items of inputs with their input, and None in each round; see ``Node.arrivals``."""
    check_open(core, inputs)
    buffers = [each.intake.buffer for each in inputs]

    def has_work() -> object:
        return core.stopping or is_due() or any(buffer.filled for buffer in buffers)

    try:
        while not core.stopping and not core.inputs.isdisjoint(inputs):  # one is open
            core.health.loop_alive()
            core.consumer.filled.wait_for(has_work, POLL_S)
            yield None
            for each in inputs:
                if core.stopping:
                    break
                core.activate()
                item = each.take(0.0)
                if item is not None:
                    yield each, item
    finally:
        for each in inputs:
            each.close()


def check_rate(rate_hz: float) -> None:
    """Raise ValueError for a rate that is none."""
    if not 0 < rate_hz < math.inf:  # NaN is refused too
        raise ValueError(f"a rate of {rate_hz:g} Hz; it must be above 0 and finite")


def ticks(core: Core, rate_hz: float) -> Iterator[int]:
    """Yield 0, 1, 2, ... at a rate; see ``Node.rate``."""
    check_rate(rate_hz)
    clock = core.clock
    due_ns = clock.monotonic_ns()
    for number in itertools.count():
        while not core.stopping and (wait_ns := due_ns - clock.monotonic_ns()) > 0:
            core.health.loop_alive()
            clock.sleep(min(wait_ns / 1e9, POLL_S))  # a stop does not end it
        if core.stopping:
            return
        core.health.loop_alive()
        core.activate()
        yield number
        due_ns = max(due_ns + round(1e9 / rate_hz), clock.monotonic_ns())
