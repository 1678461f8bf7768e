"""Statistics of streams by key and publisher, from headers alone: rates, spreads, lost frames."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import partial

import zenoh

from zenoh_vision.messages import Header
from zv.tools.shared.session import ToolSession
from zv.tools.topic.message_fields import Received, header_of, received

MAX_STREAMS = 2000
MAX_WAITING = 20_000
"""Most samples that wait for the next update."""

MAX_EPOCHS = 8
FAR_AHEAD = 1000
"""A larger step of the sequence number counts only when the next number confirms it."""
MAX_MISSING = 10_000
"""Limit of missing numbers that are kept per epoch, so that late ones are not counted as lost."""
MAX_ALL_MISSING = 200_000
"""Limit for all streams together, some 15 MB; with the limit per epoch alone, it could be 11 GB."""

SPREAD = ("min", "max", "std", "p50", "p99")
"""Statistics of a distribution; the percentiles are by nearest rank."""


def spread(values: Sequence[float]) -> dict[str, float]:
    """Return the statistics of a distribution by the names in ``SPREAD``; empty without values."""
    if not values:
        return {}
    ordered = sorted(values)
    count = len(ordered)
    mean = math.fsum(ordered) / count
    deviation = math.sqrt(math.fsum((value - mean) ** 2 for value in ordered) / count)
    p50, p99 = (ordered[math.ceil(count * percent / 100) - 1] for percent in (50, 99))
    return {"min": ordered[0], "max": ordered[-1], "std": deviation, "p50": p50, "p99": p99}


def rate_of(times_s: Sequence[float], begin_s: float, end_s: float) -> float:
    """Return messages per second; 0 if there are fewer than two.

    The time before the first message and after the last counts only where it exceeds the mean
    period. Counted in full, it would make a steady stream look too slow; ignored, it would make
    a stream that began late or stopped look too fast.

    Args:
        times_s: Arrival times, ascending.
        begin_s: When the measurement began.
        end_s: When it ended.
    """
    if len(times_s) < 2:
        return 0.0
    periods = len(times_s) - 1
    span_s = times_s[-1] - times_s[0]
    period_s = span_s / periods
    late_s = max(0.0, times_s[0] - begin_s - period_s)
    overdue_s = max(0.0, end_s - times_s[-1] - period_s)
    return periods / max(span_s + late_s + overdue_s, 1e-6)


@dataclass(slots=True)
class _Epoch:
    newest: int
    ahead: int | None = None
    missing: set[int] = field(default_factory=set)


@dataclass(slots=True)
class Room:
    """How many more missing sequence numbers may be kept, by all streams together."""

    left: int = MAX_ALL_MISSING


class SequenceGaps:
    """Counts sequence numbers that never arrived, within each epoch of each camera.

    A number that arrives late no longer counts as lost; one that arrives twice counts as repeated.
    One that is far ahead counts once a number soon after it has confirmed it, since any client can
    publish a message with any number.
    """

    def __init__(self, room: Room | None = None) -> None:
        self._room = room or Room()
        self.lost = 0
        self.repeated = 0
        self.restarts = 0
        self._epochs: dict[tuple[str, int], _Epoch] = {}

    def add(self, camera: str, epoch: int, seq: int) -> None:
        """Add the sequence number of a message."""
        known = self._epochs.get((camera, epoch))
        if known is None:
            self.restarts += any(earlier == camera for earlier, _ in self._epochs)
            if len(self._epochs) == MAX_EPOCHS:
                self._forget(next(iter(self._epochs)))
            self._epochs[camera, epoch] = _Epoch(seq)
        elif seq > known.newest + FAR_AHEAD:
            ahead, known.ahead = known.ahead, seq
            if ahead is not None and ahead < seq <= ahead + FAR_AHEAD:
                self._advance(known, ahead)
                self._advance(known, seq)
        elif seq > known.newest:
            self._advance(known, seq)
        elif seq in known.missing:
            known.missing.discard(seq)
            self._room.left += 1
            self.lost -= 1
        else:
            self.repeated += 1

    def clear(self) -> None:
        """Forget which numbers are missing, but not how many."""
        for epoch in list(self._epochs):
            self._forget(epoch)

    def _forget(self, epoch: tuple[str, int]) -> None:
        self._room.left += len(self._epochs.pop(epoch).missing)

    def _advance(self, known: _Epoch, seq: int) -> None:
        gap = seq - known.newest - 1
        kept = min(gap, MAX_MISSING - len(known.missing), self._room.left)
        self._room.left -= kept
        known.missing.update(range(seq - kept, seq))
        known.newest = seq
        self.lost += gap


class StreamStatistics:
    """Statistics of a node's samples on a key over a moving window; None: without a header."""

    def __init__(self, key: str, node: str | None, room: Room | None = None) -> None:
        self.key = key
        self.node = node
        self.encoding = ""
        self.total = 0
        self.gaps = SequenceGaps(room)
        self.times_s: deque[float] = deque()
        self.sizes: deque[int] = deque()
        self.delays_ms: deque[float] = deque()

    @property
    def name(self) -> str:
        """Key and publisher, for people."""
        return f"{self.key} [{'no header' if self.node is None else self.node}]"

    @property
    def lost(self) -> int | None:
        """Frames of its camera that never arrived since the first one; None without headers."""
        return None if self.node is None else self.gaps.lost

    def add(self, sample: Received, header: Header | None) -> None:
        """Add a message."""
        self.encoding = sample.encoding
        self.total += 1
        self.times_s.append(sample.arrived_ns / 1e9)
        self.sizes.append(sample.size)
        if header is not None:
            self.delays_ms.append((sample.received_ns - header.stamp_ns) / 1e6)
            self.gaps.add(header.camera, header.epoch, header.seq)

    def drop_before(self, begin_s: float) -> None:
        """Remove messages older than a time from the window."""
        while self.times_s and self.times_s[0] < begin_s:
            self.times_s.popleft()
            self.sizes.popleft()
            if self.delays_ms:
                self.delays_ms.popleft()


class StreamMonitor:
    """Subscribes to key expressions and keeps statistics of every stream that arrives.

    Zenoh's thread only copies a few attributes of each sample; ``update`` does the rest. A key
    that matches several key expressions counts once.
    """

    def __init__(self, session: ToolSession, patterns: Sequence[str]) -> None:
        self._streams: dict[tuple[str, str | None], StreamStatistics] = {}
        self._waiting: deque[Received] = deque()
        self._room = Room()
        self.left_out = 0
        """How many samples of more streams than can be kept were left out."""
        expressions = [zenoh.KeyExpr(pattern) for pattern in dict.fromkeys(patterns)]
        wild = [each for each in expressions if "*" in str(each)]
        keys = [each for each in expressions if "*" not in str(each)]
        self._subscribers = [
            session.subscribe(str(expression), partial(self._receive, wild[:index]))
            for index, expression in enumerate(wild)
        ]
        self._subscribers += [
            session.subscribe(str(key), partial(self._receive, ()))
            for key in keys
            if not any(each.intersects(key) for each in wild)  # else a wildcard covers it
        ]

    @property
    def streams(self) -> list[StreamStatistics]:
        """All streams as of the last update, by key and publisher."""
        return sorted(self._streams.values(), key=lambda stream: (stream.key, stream.node or ""))

    def update(self) -> None:
        """Add the samples that have arrived since the last call."""
        while self._waiting:
            sample = self._waiting.popleft()
            header = header_of(sample.attachment)
            name = sample.key, None if header is None else header.node
            if name not in self._streams:
                if len(self._streams) >= MAX_STREAMS:
                    self.left_out += 1
                    continue
                self._streams[name] = StreamStatistics(*name, self._room)
            self._streams[name].add(sample, header)

    def forget(self, stream: StreamStatistics) -> None:
        """Remove a stream that has ended."""
        del self._streams[stream.key, stream.node]
        stream.gaps.clear()

    def received_any(self) -> bool:
        """Whether any sample has arrived."""
        return bool(self._waiting or self._streams)

    def close(self) -> None:
        """Unsubscribe."""
        for subscriber in self._subscribers:
            subscriber.undeclare()

    def _receive(self, earlier: Sequence[zenoh.KeyExpr], sample: zenoh.Sample) -> None:
        # If an earlier pattern matches too, its own subscriber has received this sample.
        if len(self._waiting) >= MAX_WAITING:
            self.left_out += 1
        elif not any(other.intersects(sample.key_expr) for other in earlier):
            self._waiting.append(received(sample, payload=False))
