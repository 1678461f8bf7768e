"""Waiting for what must happen, under a deadline: the only way these tests wait."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from typing import TypeVar

from zenoh_vision.image.frame import Frame
from zenoh_vision.node.node import Node

POLL_S = 0.005
DEADLINE_S = 30.0
"""Ends a test that would wait for ever. It says nothing of speed: a busy machine may need most."""

T = TypeVar("T")


def wait_until(
    condition: Callable[[], T],
    deadline_s: float = DEADLINE_S,
    explain: Callable[[], str] | None = None,
    poll_s: float = POLL_S,
) -> T:
    """Return the condition's first true value.

    Args:
        condition: Asked every few milliseconds.
        deadline_s: Fail after so long.
        explain: What to say then.
        poll_s: Pause before it is asked again.
    """
    end = time.monotonic() + deadline_s
    while not (result := condition()):
        assert time.monotonic() < end, (
            f"nothing within {deadline_s:g} s{': ' + explain() if explain else ''}"
        )
        time.sleep(poll_s)
    return result


def in_time(node: Node, frames: Iterator[Frame], deadline_s: float = DEADLINE_S) -> Iterator[Frame]:
    """Yield a node's frames, but stop the node after the deadline, so that no test hangs."""
    alarm = threading.Timer(deadline_s, node.stop)
    alarm.daemon = True
    alarm.start()
    try:
        yield from frames
    finally:
        alarm.cancel()
