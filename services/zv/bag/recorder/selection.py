"""Which keys are recorded, and subscriptions to them, without taking a sample twice."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence

import zenoh

from zenoh_vision import keys
from zenoh_vision.topics import TOPICS, topic_of
from zenoh_vision.transport.link import Declaration, Link
from zenoh_vision.transport.session import direct
from zv.bag.recording import matcher

MAX_SUBSCRIPTIONS = 1000


def default_keys(namespace: str) -> tuple[str, ...]:
    """Return the key expressions of the cameras' data that is not made for display only."""
    return tuple(each.key(namespace, "*") for each in TOPICS.values() if each.recorded)


def system_keys(namespace: str) -> tuple[str, ...]:
    """Return the key expressions of what is needed to understand the cameras' data."""
    return (keys.parameter_key(namespace, "*", "*"), keys.diagnostics_key(namespace, "*"))


class Subscriptions:
    """Subscriptions to key expressions, which may overlap.

    ``receive`` is called with each sample, once, on Zenoh's threads.
    """

    def __init__(
        self, link: Link, exclude: Sequence[str], receive: Callable[[zenoh.Sample], None]
    ) -> None:
        self._link = link
        self._is_excluded = matcher(exclude, without_any=False)
        self._receive = receive
        self._declared: dict[str, Declaration[zenoh.Subscriber[None]]] = {}

    @property
    def keys(self) -> tuple[str, ...]:
        """The key expressions."""
        return tuple(self._declared)

    def add(self, expression: str) -> None:
        """Subscribe to a key expression, unless those before include it."""
        wanted = zenoh.KeyExpr.autocanonize(expression.removeprefix("/"))
        if any(zenoh.KeyExpr(each).includes(wanted) for each in self._declared):
            return
        if len(self._declared) >= MAX_SUBSCRIPTIONS:
            return
        is_taken = matcher(tuple(self._declared), without_any=False)

        def on_sample(sample: zenoh.Sample) -> None:
            key = str(sample.key_expr)
            if not is_taken(key) and not self._is_excluded(key):
                self._receive(sample)

        self._declared[str(wanted)] = self._link.declare(
            lambda session: session.declare_subscriber(wanted, direct(on_sample))
        )

    def close(self) -> None:
        """End all subscriptions."""
        for each in self._declared.values():
            each.undeclare()
        self._declared = {}


def found_keys(namespace: str, published: Iterable[str]) -> Iterable[str]:
    """Yield those of the keys that somebody publishes which belong to a default recording."""
    for key in published:
        topic = topic_of(key)
        is_ours = key.startswith(f"{namespace}/") and "*" not in key
        if is_ours and (topic is None or topic.recorded):
            yield key
