"""A loop at a rate that ends when its node stops."""

from __future__ import annotations

import itertools
import math
import time
from collections.abc import Iterator
from typing import Any, Protocol

from zenoh_vision.config.revisions import ParameterStore
from zenoh_vision.health.health import Health
from zenoh_vision.node.inputs import POLL_S


class Owner(Protocol):
    """The part of a node that a loop at a rate uses."""

    health: Health
    parameters: ParameterStore[Any] | None
    stopping: bool


def ticks(node: Owner, rate_hz: float) -> Iterator[int]:
    """Yield 0, 1, 2, ... at a rate; see ``Node.rate``."""
    if not 0 < rate_hz < math.inf:  # NaN is refused too
        raise ValueError(f"a rate of {rate_hz:g} Hz; it must be above 0 and finite")
    due_s = time.monotonic()
    for number in itertools.count():
        while not node.stopping and (wait_s := due_s - time.monotonic()) > 0:
            node.health.loop_alive()
            time.sleep(min(wait_s, POLL_S))  # the handlers of signals only set ``stopping``
        if node.stopping:
            return
        node.health.loop_alive()
        if node.parameters is not None:
            node.parameters.activate()
        yield number
        due_s = max(due_s + 1 / rate_hz, time.monotonic())
