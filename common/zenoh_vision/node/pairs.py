"""Two inputs of a node in one loop, paired by the stamps of their items."""

from __future__ import annotations

import time
from collections.abc import Iterator
from typing import Any

from zenoh_vision.errors import PayloadError
from zenoh_vision.image.frame import Frame
from zenoh_vision.image.pixel_formats import MAX_PIXEL_BYTES
from zenoh_vision.messages import Stamped
from zenoh_vision.node.inputs import POLL_S, Input, Owner, check_open
from zenoh_vision.stream.buffer import wait_for_any
from zenoh_vision.stream.pairing import PairBuffer

TOLERANCE_S = 0.015
"""Just below half of the time between two frames at 30 Hz."""

WAIT_S = 0.5
DEPTH = 20
MIN_POLL_S = 0.005

Item = Frame | Stamped


def paired(
    node: Owner,
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
        node,
        (first, second),
        PairBuffer[Item](int(tolerance_s * 1e9), int(wait_s * 1e9), depth),
        max(MIN_POLL_S, min(POLL_S, wait_s)),
        depth,
        alone=alone,
    )


def _loop(
    node: Owner,
    inputs: tuple[Input[Any], Input[Any]],
    waiting: PairBuffer[Item],
    poll_s: float,
    depth: int,
    *,
    alone: bool,
) -> Iterator[tuple[Any, Any]]:
    check_open(node, inputs)
    buffers = [each.intake.buffer for each in inputs]
    try:
        while not node.stopping:
            node.health.loop_alive()
            wait_for_any(node.consumer.filled, buffers, poll_s)
            _take(node, inputs, waiting, depth)
            for pair in waiting.take(time.monotonic_ns()):
                if None in pair and not alone:
                    node.counters.drop("unpaired")
                    continue
                _activate(node, pair)
                try:
                    yield pair
                finally:
                    for each, item in zip(inputs, pair, strict=True):
                        if item is not None:
                            each.done(item)
                if node.stopping:
                    break
    finally:
        for _ in waiting.clear():
            if not node.stopping:
                node.counters.drop("unread")
        for each in inputs:
            each.close()


def _take(
    node: Owner, inputs: tuple[Input[Any], Input[Any]], waiting: PairBuffer[Item], depth: int
) -> None:
    """Move the items that have arrived to the buffer of pairs, at most ``depth`` of each input.

    A silent input is taken from once too, since that makes it follow the camera and the parameters.
    """
    for side, each in enumerate(inputs):
        for number in range(depth):
            if node.stopping or (number and not each.intake.buffer.filled):
                break
            if node.parameters is not None:
                node.parameters.activate()
            item = each.take(0.0)
            now_ns = time.monotonic_ns()
            if isinstance(item, Frame):
                header = item.header
                size = header.width * header.height * MAX_PIXEL_BYTES
                waiting.put(side, header.stamp_ns, item.keep(), now_ns, size)
            elif isinstance(item, Stamped):
                waiting.put(side, item.header.stamp_ns, item, now_ns)
            elif item is not None:
                error = PayloadError("no_header", f"{type(item).__name__} on {each.intake.key}")
                node.counters.drop(error.reason)
                node.health.log_drop(error)


def _activate(node: Owner, pair: tuple[Item | None, Item | None]) -> None:
    """Process both items of a pair with the same revision of the parameters, the newest."""
    if node.parameters is None:
        return
    revision = node.parameters.activate()
    for item in pair:
        if isinstance(item, Frame):
            item.revision = revision
