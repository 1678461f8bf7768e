"""Statistics of streams by key and publisher, from headers alone: rates, spreads, lost frames."""

from __future__ import annotations

import math
import random
from array import array
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import partial

import zenoh

from zv.tools.shared.received import Received, header_of, received
from zv.tools.shared.session import ToolSession

MAX_STREAMS = 2000
MAX_WAITING = 20_000
"""Most samples that wait for the next update."""

MAX_RECENT = 200_000
"""Most samples of a moving window, of all streams together; if there are more, it is shorter."""

UPDATE_S = 1.0
KEPT = 5000
"""Percentiles are exact up to this many values, and those of a uniform sample of more."""

MAX_EPOCHS = 8
FAR_AHEAD = 1000
"""A larger step of the sequence number counts only when the next number confirms it."""
MAX_MISSING = 100
"""The newest missing numbers that are kept per epoch; a late one of them is not lost."""

TOO_MANY = "more streams or messages come than can be kept: some are left out"

SPREAD = ("min", "max", "std", "p50", "p99")
"""Statistics of a distribution; the percentiles are by nearest rank."""


class Distribution:
    """The distribution of any number of values, in bounded memory."""

    def __init__(self) -> None:
        self.count = 0
        self.mean = 0.0
        self._squares = 0.0
        self._low, self._high = math.inf, -math.inf
        self._kept = array("d")
        self._random = random.Random(1)  # noqa: S311 - no secret

    def add(self, value: float) -> None:
        """Add a value."""
        self.count += 1
        off = value - self.mean
        self.mean += off / self.count
        self._squares += off * (value - self.mean)  # Welford's method: no large sums cancel out
        self._low, self._high = min(self._low, value), max(self._high, value)
        if self.count <= KEPT:
            self._kept.append(value)
        elif (place := int(self._random.random() * self.count)) < KEPT:
            self._kept[place] = value

    def spread(self) -> dict[str, float]:
        """Return the statistics by the names in ``SPREAD``; empty without values."""
        if not self.count:
            return {}
        ordered = sorted(self._kept)
        p50, p99 = (ordered[math.ceil(len(ordered) * part / 100) - 1] for part in (50, 99))
        deviation = math.sqrt(self._squares / self.count)
        return {"min": self._low, "max": self._high, "std": deviation, "p50": p50, "p99": p99}


def rate_of(count: int, first_s: float, last_s: float, begin_s: float, end_s: float) -> float:
    """Return messages per second; 0 if there are fewer than two.

    The time before the first message and after the last counts only where it exceeds the mean
    period. Counted in full, it would make a steady stream look too slow; ignored, it would make
    a stream that began late or stopped look too fast.
    """
    if count < 2:
        return 0.0
    span_s = last_s - first_s
    period_s = span_s / (count - 1)
    late_s = max(0.0, first_s - begin_s - period_s)
    overdue_s = max(0.0, end_s - last_s - period_s)
    return (count - 1) / max(span_s + late_s + overdue_s, 1e-6)


class Samples:
    """Totals of the samples of a stream over some time, in bounded memory."""

    def __init__(self) -> None:
        self.first_s = self.last_s = 0.0
        self.sizes = Distribution()
        self.periods_ms = Distribution()
        self.delays_ms = Distribution()

    @property
    def count(self) -> int:
        """Number of samples."""
        return self.sizes.count

    def add(self, time_s: float, size: int, delay_ms: float | None) -> None:
        """Add a sample; its delay is unknown without a header."""
        if self.count:
            self.periods_ms.add((time_s - self.last_s) * 1e3)
        else:
            self.first_s = time_s
        self.last_s = time_s
        self.sizes.add(size)
        if delay_ms is not None:
            self.delays_ms.add(delay_ms)

    def rate_hz(self, begin_s: float, end_s: float) -> float:
        """Return the rate in a measurement from one time to another."""
        return rate_of(self.count, self.first_s, self.last_s, begin_s, end_s)


@dataclass(slots=True)
class _Epoch:
    newest: int
    ahead: int | None = None
    missing: dict[int, None] = field(default_factory=dict)


class SequenceGaps:
    """Counts sequence numbers that never arrived, within each epoch of each camera.

    A number that arrives late no longer counts as lost; one that arrives twice counts as repeated.
    One that is far ahead counts once a number soon after it has confirmed it, since any client can
    publish a message with any number.
    """

    def __init__(self) -> None:
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
                del self._epochs[next(iter(self._epochs))]
            self._epochs[camera, epoch] = _Epoch(seq)
        elif seq > known.newest + FAR_AHEAD:
            ahead, known.ahead = known.ahead, seq
            if ahead is not None and ahead < seq <= ahead + FAR_AHEAD:
                self._advance(known, ahead)
                self._advance(known, seq)
        elif seq > known.newest:
            self._advance(known, seq)
        elif seq in known.missing:
            del known.missing[seq]
            self.lost -= 1
        else:
            self.repeated += 1

    def _advance(self, known: _Epoch, seq: int) -> None:
        gap = seq - known.newest - 1
        known.missing |= dict.fromkeys(range(seq - min(gap, MAX_MISSING), seq))
        for oldest in list(known.missing)[: max(0, len(known.missing) - MAX_MISSING)]:
            del known.missing[oldest]
        known.newest = seq
        self.lost += gap


def rate_of_parts(parts: Sequence[Samples], begin_s: float, end_s: float) -> float | None:
    """Return the rate of one or more publishers of a key; None for fewer than two samples."""
    count = sum(part.count for part in parts)
    if count < 2:
        return None
    first_s, last_s = min(part.first_s for part in parts), max(part.last_s for part in parts)
    return rate_of(count, first_s, last_s, begin_s, end_s)


class StreamStatistics:
    """Statistics of a node's samples on a key since the first one; ``node`` None: no header."""

    def __init__(self, key: str, node: str | None) -> None:
        self.key = key
        self.node = node
        self.encoding = ""
        self.gaps = SequenceGaps()
        self.samples = Samples()

    @property
    def name(self) -> str:
        """Key and publisher, for people."""
        return f"{self.key} [{'no header' if self.node is None else self.node}]"

    @property
    def lost(self) -> int | None:
        """Frames of its camera that never arrived since the first one; None without headers."""
        return None if self.node is None else self.gaps.lost


class StreamMonitor:
    """Subscribes to key expressions and keeps statistics of every stream that arrives.

    Zenoh's thread only copies a few attributes of each sample; ``update`` does the rest, and must
    be called about once a second. A key that matches several key expressions counts once.

    Args:
        session: An open session.
        patterns: The key expressions.
        moving: Whether to keep the newest samples, for ``within``.
    """

    def __init__(
        self, session: ToolSession, patterns: Sequence[str], *, moving: bool = False
    ) -> None:
        self._session = session
        self._streams: dict[tuple[str, str | None], StreamStatistics] = {}
        self._waiting: deque[tuple[float, Received]] = deque()
        self._recent: deque[tuple[StreamStatistics, float, int, float | None]] | None = (
            deque(maxlen=MAX_RECENT) if moving else None
        )
        self.left_out = 0
        """How many samples were left out: of too many streams, or too many at once."""
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

    def measure(self, seconds: float) -> tuple[float, float]:
        """Add the samples that arrive in a time, or until told to stop; return begin and end."""
        begin_s = now_s = self._session.clock()
        end_s = begin_s + seconds
        while now_s < end_s and self._session.wait(min(UPDATE_S, end_s - now_s)):
            self.update()
            now_s = self._session.clock()
        return begin_s, now_s

    def update(self) -> None:
        """Add the samples that have arrived since the last call."""
        while self._waiting:
            time_s, sample = self._waiting.popleft()
            header = header_of(sample.attachment)
            name = sample.key, None if header is None else header.node
            stream = self._streams.get(name)
            if stream is None:
                if self.is_full:
                    self.left_out += 1
                    continue
                stream = self._streams[name] = StreamStatistics(*name)
            delay_ms = None
            if header is not None:
                delay_ms = (sample.received_ns - header.age_start_ns) / 1e6
                stream.gaps.add(header.camera, header.epoch, header.seq)
            stream.encoding = sample.encoding
            stream.samples.add(time_s, sample.size, delay_ms)
            if self._recent is not None:
                self._recent.append((stream, time_s, sample.size, delay_ms))

    def within(self, begin_s: float) -> tuple[dict[StreamStatistics, Samples], float]:
        """Return the samples since a time by stream, and since when they are kept: later if many.

        Requires ``moving``; a later call must not name an earlier time.
        """
        recent = self._recent
        assert recent is not None
        if len(recent) == MAX_RECENT:
            begin_s = max(begin_s, recent[0][1])
        while recent and recent[0][1] < begin_s:
            recent.popleft()
        found: dict[StreamStatistics, Samples] = {}
        for stream, time_s, size, delay_ms in recent:
            found.setdefault(stream, Samples()).add(time_s, size, delay_ms)
        return found, begin_s

    @property
    def is_full(self) -> bool:
        """Whether a stream that is new is left out."""
        return len(self._streams) >= MAX_STREAMS

    def forget(self, stream: StreamStatistics) -> None:
        """Remove a stream, for another to have its place."""
        del self._streams[stream.key, stream.node]

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
        elif sample.kind == zenoh.SampleKind.PUT and not any(
            other.intersects(sample.key_expr) for other in earlier
        ):
            self._waiting.append((self._session.clock(), received(sample, payload=False)))
