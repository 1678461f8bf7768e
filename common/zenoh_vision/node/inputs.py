"""The inputs of a node: iterables of the items that arrive on a key, alone or several at once."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Any, Generic, Protocol, TypeVar

from zenoh_vision.config.revisions import ParameterStore
from zenoh_vision.health.health import Health
from zenoh_vision.image.frame import Frame
from zenoh_vision.messages import Stamped
from zenoh_vision.stream.buffer import wait_for_any
from zenoh_vision.stream.counters import FrameCounters
from zenoh_vision.stream.intake import Consumer, Intake
from zenoh_vision.transport.link import Link
from zenoh_vision.transport.subscriber import subscribe

POLL_S = 0.1

T = TypeVar("T", covariant=True)


class Subscription(Protocol):
    """Passes samples to an intake until it is undeclared."""

    def undeclare(self) -> None:
        """End the subscription."""


class Owner(Protocol):
    """The part of a node that an input uses."""

    health: Health
    counters: FrameCounters
    consumer: Consumer
    inputs: set[Input[Any]]
    parameters: ParameterStore[Any] | None
    stopping: bool

    @property
    def link(self) -> Link:
        """The link to the router."""


class Input(Generic[T]):
    """The items that arrive on a key or key expression: an iterable that ends when the node stops.

    The subscription exists from here until the iteration ends, also by ``break``, or the node
    closes; so an input can be iterated once. The time that the loop spends on an item is measured,
    and the item counted as processed, when it asks for the next. Silence on an input of frames is
    part of the node's health.

    Args:
        node: The node that it belongs to.
        intake: Receives its samples.
        take: Returns the next item; None after a time-out in seconds, or if it was dropped.
        subscription: Passes samples to the intake; by default one to the intake's key.
    """

    def __init__(
        self,
        node: Owner,
        intake: Intake[Any, T],
        take: Callable[[float], T | None],
        subscription: Subscription | None = None,
    ) -> None:
        self.intake = intake
        self.take = take
        self.closed = False
        self._node = node
        self._subscription = subscription or subscribe(node.link, intake)
        node.health.watch(intake)
        node.inputs.add(self)

    def __iter__(self) -> Iterator[T]:
        """Yield the items that arrive until the node is told to stop.

        Raises:
            RuntimeError: The input is closed, since a loop over it has ended.
        """
        return merged(self._node, (self,))

    def done(self, item: object) -> None:
        """Count an item as processed, with the time since its capture if it has a header."""
        self._node.counters.finish()
        stamp_ns = item.header.stamp_ns if isinstance(item, Frame | Stamped) else None
        self._node.health.done(stamp_ns)

    def close(self) -> None:
        """Unsubscribe and drop the items that wait as ``unread``; safe to call twice.

        While the node stops, these items stay pending in its counters.
        """
        if self.closed:
            return
        self.closed = True
        self._node.inputs.discard(self)
        self._node.health.unwatch(self.intake)
        try:
            self._subscription.undeclare()
        finally:
            if self._node.stopping:
                self.intake.close()
            else:
                self.intake.close(unread="unread")


def check_open(node: Owner, inputs: Sequence[Input[Any]]) -> None:
    """Check that a loop over inputs can begin.

    Raises:
        RuntimeError: One is closed, and the node is not stopping.
    """
    for each in inputs:
        if each.closed and not node.stopping:
            raise RuntimeError(
                f"the input on {each.intake.key} is closed, as every input is when its loop ends; "
                "open another with node.frames, node.messages or node.samples"
            )


def merged(node: Owner, inputs: Sequence[Input[Any]]) -> Iterator[Any]:
    """Yield the items of a node's inputs until it is told to stop.

    The inputs are served in turn, so that a fast one does not starve the others. The newest
    revision of the node's parameters is activated before each item.

    Raises:
        RuntimeError: An input is closed, as a loop over it has ended.
    """
    check_open(node, inputs)
    buffers = [each.intake.buffer for each in inputs]
    try:
        while not node.stopping:
            node.health.loop_alive()
            wait_for_any(node.consumer.filled, buffers, POLL_S)
            for each in inputs:
                if node.stopping:
                    break
                if node.parameters is not None:
                    node.parameters.activate()
                item = each.take(0.0)
                if item is None:
                    continue
                try:
                    yield item
                finally:
                    each.done(item)
    finally:
        for each in inputs:
            each.close()
