"""Keys and what flows on them, watched for a while without making anything flow."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

import zenoh

from common.keys import TOPICS
from services.tools.session import ToolSession
from services.tools.survey import Survey
from services.tools.topic.arrivals import identity_of, without_included
from services.tools.topic.figures import rate_of
from services.tools.types import topic_of, type_of

State = Literal["flowing", "silent", "on demand"]


@dataclass(slots=True)
class Seen:
    """What was seen of a key while it was watched."""

    times_s: list[float] = field(default_factory=list)
    encoding: str = ""
    nodes: set[str] = field(default_factory=set)


@dataclass(frozen=True, slots=True)
class Entry:
    """One key of the list.

    Attributes:
        publishers: Names of nodes, or ``?`` for each session that does not say its name.
        subscribers: Sessions besides ours; None if the router does not tell.
        rate_hz: None if it is not known.
    """

    key: str
    encoding: str
    publishers: tuple[str, ...]
    subscribers: int | None
    state: State
    rate_hz: float | None

    def row(self) -> list[object]:
        """Return its row of the table."""
        rate = self.state if self.state != "flowing" else f"{self.rate_hz or 0:.1f}"
        return [
            self.key,
            type_of(self.encoding),
            self.encoding or None,
            ", ".join(self.publishers) or None,
            self.subscribers,
            "~1" if self.state == "flowing" and self.rate_hz is None else rate,
        ]

    def line(self) -> str:
        """Return it as one line of text."""
        return "  ".join("-" if cell is None else str(cell) for cell in self.row())

    def record(self) -> dict[str, Any]:
        """Return it for JSON."""
        return {
            "key": self.key,
            "type": type_of(self.encoding),
            "encoding": self.encoding,
            "publishers": list(self.publishers),
            "subscribers": self.subscribers,
            "state": self.state,
            "rate_hz": None if self.rate_hz is None else round(self.rate_hz, 3),
        }


def observe(
    session: ToolSession, found: Survey, pattern: str, window_s: float, *, everything: bool = False
) -> list[Entry]:
    """Watch what flows for a while, and return every key that is known or was seen, in order.

    Args:
        session: An open session.
        found: What there is.
        pattern: Key expression of what is asked for.
        window_s: How long to watch.
        everything: Subscribe to the pattern itself, whatever that makes flow.
    """
    patterns = [pattern] if everything else harmless(found, pattern, session.namespace)
    seen: dict[str, Seen] = {}
    samples: deque[tuple[float, str, str, bytes | None]] = deque()
    wanted = zenoh.KeyExpr(pattern)
    subscribers = []
    for index, each in enumerate(patterns):
        earlier = [zenoh.KeyExpr(other) for other in patterns[:index]]

        def take(sample: zenoh.Sample, earlier: Sequence[zenoh.KeyExpr] = earlier) -> None:
            key = sample.key_expr
            if not wanted.intersects(key) or any(other.intersects(key) for other in earlier):
                return
            header = None if sample.attachment is None else sample.attachment.to_bytes()
            samples.append((time.monotonic(), str(key), str(sample.encoding), header))

        subscribers.append(session.subscribe(each, take))
    begin_s = time.monotonic()
    session.wait(window_s)
    end_s = time.monotonic()
    for subscriber in subscribers:
        subscriber.undeclare()
    for at_s, key, encoding, attachment in samples:
        record = seen.setdefault(key, Seen())
        record.times_s.append(at_s)
        record.encoding = encoding
        identity = identity_of(attachment)
        if identity is not None and identity.node:
            record.nodes.add(identity.node)
    watched = [zenoh.KeyExpr(each) for each in patterns]
    return [
        _entry(key, found, seen.get(key), watched, (begin_s, end_s))
        for key in sorted(found.keys(pattern) | set(seen))
    ]


def harmless(found: Survey, pattern: str, namespace: str) -> list[str]:
    """Return the key expressions to which one can subscribe without making anything flow.

    That is: topics which are always published, keys of others who do not wait for subscribers,
    and whatever someone subscribes to already.
    """
    patterns = [f"{namespace}/*/{topic.suffix}" for topic in TOPICS.values() if not topic.lazy]
    patterns += list(found.subscribers)
    for key in found.keys(pattern):
        topic = topic_of(key)
        by_others = found.publisher_count(key) > len(found.nodes_publishing(key))
        if topic is None or not topic.lazy or by_others:
            patterns.append(key)
    wanted = zenoh.KeyExpr(pattern)
    return without_included([each for each in patterns if wanted.intersects(zenoh.KeyExpr(each))])


def _entry(
    key: str,
    found: Survey,
    seen: Seen | None,
    watched: Sequence[zenoh.KeyExpr],
    window: tuple[float, float],
) -> Entry:
    topic = topic_of(key)
    names = sorted({*found.nodes_publishing(key), *(seen.nodes if seen else ())})
    unnamed = max(0, found.publisher_count(key) - len(names))
    expression = zenoh.KeyExpr(key)
    state: State = "on demand"
    if seen:
        state = "flowing"
    elif any(each.intersects(expression) for each in watched):
        state = "silent"
    times_s = seen.times_s if seen else []
    return Entry(
        key=key,
        encoding=seen.encoding if seen else topic.encoding if topic else "",
        publishers=(*names, *["?"] * unnamed),
        subscribers=found.subscriber_count(key),
        state=state,
        rate_hz=None if state == "on demand" or len(times_s) == 1 else rate_of(times_s, *window),
    )
