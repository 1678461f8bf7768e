"""What came on some key expressions: by key and publisher, from attachments alone."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import msgpack
import zenoh

from services.tools.session import ToolSession
from services.tools.topic.figures import Gaps

MAX_ATTACHMENT_BYTES = 4096
MOST_TEXT = 128

Arrival = tuple[str, int, int, int, bytes | None]
"""Key, monotonic ns, wall clock ns, payload bytes, attachment."""


@dataclass(frozen=True, slots=True)
class Identity:
    """What of a header is needed to count: who sent which frame, when it was captured."""

    node: str
    camera: str
    epoch: int
    seq: int
    stamp_ns: int


def identity_of(attachment: bytes | None) -> Identity | None:
    """Return the identity in an attachment; None if there is none, or it is someone else's.

    Not the full check that a service makes: a tool counts what is there.
    """
    if attachment is None or len(attachment) > MAX_ATTACHMENT_BYTES:
        return None
    try:
        header: Any = msgpack.unpackb(attachment)
        node = header.get("node", "")
        found = Identity(
            node[:MOST_TEXT] if isinstance(node, str) else "",
            header["camera"],
            header["epoch"],
            header["seq"],
            header["stamp_ns"],
        )
    except (ValueError, KeyError, TypeError, AttributeError, msgpack.UnpackException):
        return None
    numbers = (found.epoch, found.seq, found.stamp_ns)
    sound = isinstance(found.camera, str) and all(type(number) is int for number in numbers)
    return found if sound and found.seq >= 0 else None


class Stream:
    """What one publisher sends on one key, over a window that moves.

    Args:
        key: Full key.
        node: Who sends, by the header; None for samples without one.
    """

    def __init__(self, key: str, node: str | None) -> None:
        self.key = key
        self.node = node
        self.total = 0
        self.gaps: dict[str, Gaps] = {}
        self.times_s: deque[float] = deque()
        self.sizes: deque[int] = deque()
        self.delays_ms: deque[float] = deque()

    @property
    def lost(self) -> int | None:
        """Frames of its camera that never came here since the first; None without headers."""
        return None if self.node is None else sum(gaps.lost for gaps in self.gaps.values())

    @property
    def repeated(self) -> int:
        """Messages that came twice."""
        return sum(gaps.repeated for gaps in self.gaps.values())

    @property
    def restarts(self) -> int:
        """How often a new epoch began."""
        return sum(gaps.restarts for gaps in self.gaps.values())

    def note(self, arrival: Arrival, identity: Identity | None) -> None:
        """Take note of a message."""
        _, at_ns, wall_ns, size, _ = arrival
        self.total += 1
        self.times_s.append(at_ns / 1e9)
        self.sizes.append(size)
        if identity is not None:
            self.delays_ms.append((wall_ns - identity.stamp_ns) / 1e6)
            self.gaps.setdefault(identity.camera, Gaps()).note(identity.epoch, identity.seq)

    def forget(self, before_s: float) -> None:
        """Let the window begin at a time."""
        while self.times_s and self.times_s[0] < before_s:
            self.times_s.popleft()
            self.sizes.popleft()
            if self.delays_ms:
                self.delays_ms.popleft()


class Arrivals:
    """Subscribes to key expressions and sorts what comes into streams.

    Each sample costs a handful of attributes on Zenoh's thread; the rest is done in ``sort``.

    Args:
        session: An open session.
        patterns: Key expressions; a key that several match counts once.
    """

    def __init__(self, session: ToolSession, patterns: Sequence[str]) -> None:
        self.streams: dict[tuple[str, str | None], Stream] = {}
        self._waiting: deque[Arrival] = deque()
        kept = without_included(patterns)
        self._subscribers = [
            session.subscribe(pattern, self._taker(kept[:index]))
            for index, pattern in enumerate(kept)
        ]

    def sort(self) -> None:
        """Sort what has come since the last call."""
        waiting = self._waiting
        while waiting:
            arrival = waiting.popleft()
            identity = identity_of(arrival[4])
            node = None if identity is None else identity.node
            name = (arrival[0], node)
            stream = self.streams.get(name)
            if stream is None:
                stream = self.streams[name] = Stream(*name)
            stream.note(arrival, identity)

    def any(self) -> bool:
        """Whether anything came at all."""
        return bool(self._waiting or self.streams)

    def close(self) -> None:
        """Stop to listen."""
        for subscriber in self._subscribers:
            subscriber.undeclare()

    def _taker(self, earlier: Sequence[str]) -> Callable[[zenoh.Sample], None]:
        append, monotonic_ns, time_ns = self._waiting.append, time.monotonic_ns, time.time_ns
        others = [zenoh.KeyExpr(pattern) for pattern in earlier]

        def take(sample: zenoh.Sample) -> None:
            at_ns, wall_ns = monotonic_ns(), time_ns()
            key = sample.key_expr
            if others and any(other.intersects(key) for other in others):
                return  # the subscriber of that pattern gets it as well
            attachment = sample.attachment
            append(
                (
                    str(key),
                    at_ns,
                    wall_ns,
                    len(sample.payload),
                    None if attachment is None else attachment.to_bytes(),
                )
            )

        return take


def without_included(patterns: Sequence[str]) -> list[str]:
    """Return the patterns that no other one includes, in their order, each once."""
    expressions = {pattern: zenoh.KeyExpr(pattern) for pattern in patterns}
    return [
        pattern
        for pattern, expression in expressions.items()
        if not any(
            other is not expression and other.includes(expression) for other in expressions.values()
        )
    ]
