"""Two inputs of a node in one loop, paired by the stamps of their items."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from zenoh_vision.errors import PayloadError
from zenoh_vision.image.frame import Frame
from zenoh_vision.image.limits import MAX_PIXEL_BYTES
from zenoh_vision.messages import Stamped
from zenoh_vision.node.core import Core
from zenoh_vision.node.inputs import POLL_S, Input, check_open, count_processed
from zenoh_vision.stream.buffer import wait_for_any
from zenoh_vision.stream.pairing import PairBuffer

TOLERANCE_S = 0.015
"""Just below half of the time between two frames at 30 Hz."""

WAIT_S = 0.5
DEPTH = 20
MIN_POLL_S = 0.005

Item = Frame | Stamped


def paired(
    core: Core,
    first: Input[Any],
    second: Input[Any],
    *,
    tolerance_s: float,
    wait_s: float,
    depth: int,
    alone: bool,
) -> Iterator[tuple[Any, Any]]:
    """Yield pairs of items of two inputs; see ``Node.pairs``."""
    if first is second:
        raise ValueError("two different inputs are needed for pairs")
    if tolerance_s < 0 or wait_s < 0 or depth < 1:
        raise ValueError("tolerance_s and wait_s must be at least 0, depth at least 1")
    return _loop(
        core,
        (first, second),
        PairBuffer[Item](int(tolerance_s * 1e9), int(wait_s * 1e9), depth),
        max(MIN_POLL_S, min(POLL_S, wait_s)),
        depth,
        alone=alone,
    )


def _loop(
    core: Core,
    inputs: tuple[Input[Any], Input[Any]],
    waiting: PairBuffer[Item],
    poll_s: float,
    depth: int,
    *,
    alone: bool,
) -> Iterator[tuple[Any, Any]]:
    check_open(core, inputs)
    buffers = [each.intake.buffer for each in inputs]
    try:
        over = all if alone else any  # of one input alone there are no pairs
        while not core.stopping and not over(each.closed for each in inputs):
            core.health.loop_alive()
            wait_for_any(core.consumer.filled, buffers, poll_s)
            _take(core, inputs, waiting, depth)
            for pair in waiting.take(core.clock.monotonic_ns()):
                if None in pair and not alone:
                    core.counters.drop("unpaired")
                    continue
                _activate(core, pair)
                core.take_dropped()  # of none that was handed out
                try:
                    yield pair
                finally:
                    _done(core, pair)
                if core.stopping:
                    break
    finally:
        for _ in waiting.clear():
            if not core.stopping:
                core.counters.drop("unread")
        for each in inputs:
            each.close()


def _done(core: Core, pair: tuple[Item | None, Item | None]) -> None:
    """Count the items of a pair as processed; its rate and latency are those of one item."""
    items = [item for item in pair if item is not None]
    dropped = core.take_dropped()
    for item in items[dropped:]:
        count_processed(core, item)
    if not dropped:
        core.health.done(min(item.header.age_start_ns for item in items))


def _take(
    core: Core, inputs: tuple[Input[Any], Input[Any]], waiting: PairBuffer[Item], depth: int
) -> None:
    """Move the items that have arrived to the buffer of pairs, at most ``depth`` of each input."""
    for side, each in enumerate(inputs):
        for _ in range(depth):
            if core.stopping or not each.intake.buffer.filled:
                break
            core.activate()
            item = each.take(0.0)
            now_ns = core.clock.monotonic_ns()
            if isinstance(item, Frame):
                header = item.header
                size = header.width * header.height * MAX_PIXEL_BYTES
                waiting.put(side, header.stamp_ns, item, now_ns, size)
            elif isinstance(item, Stamped):
                waiting.put(side, item.header.stamp_ns, item, now_ns)
            elif item is not None:
                error = PayloadError("no_header", f"{type(item).__name__} on {each.intake.key}")
                core.drop(error)


def _activate(core: Core, pair: tuple[Item | None, Item | None]) -> None:
    """Process both items of a pair with the same revision of the parameters, the newest."""
    revision = core.activate()
    for item in pair:
        if isinstance(item, Frame):
            item.revision = revision
