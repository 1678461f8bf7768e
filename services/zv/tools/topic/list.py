"""``zv topic list``: list keys and their rates, without starting streams."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Literal

from zenoh_vision.errors import ExpectationNotMet
from zenoh_vision.keys import type_of
from zenoh_vision.topics import TOPICS, topic_of
from zenoh_vision.transport.connection import Connection
from zenoh_vision.transport.matching import intersect
from zv.tools.shared.discovery import MAX_KEYS, Discovery, discover
from zv.tools.shared.output import Output, view_of
from zv.tools.shared.session import ToolSession, key_expression
from zv.tools.shared.statistics import TOO_MANY, StreamMonitor, StreamStatistics, rate_of_parts
from zv.tools.topic.options import ListOptions

COLUMNS = ("key", "type", "encoding", "publishers", "subscribers", "rate Hz")

State = Literal["flowing", "silent", "on demand"]


def run(options: ListOptions, connection: Connection, output: Output) -> None:
    """List keys once, or periodically.

    Raises:
        ExpectationNotMet: Nothing matches.
    """
    pattern = key_expression(options.key or f"{connection.namespace}/**")
    with ToolSession(connection) as session:
        if options.watch:
            with output.display() as display:
                while not session.stopping:
                    entries = _entries(session, discover(session), pattern, options, None)
                    rows = [entry.row() for entry in entries]
                    lines = [
                        "  ".join("-" if cell is None else str(cell) for cell in row)
                        for row in rows
                    ]
                    if not session.stopping:
                        display.show(view_of(COLUMNS, rows, lines, list(map(asdict, entries))))
            return
        found = discover(session)
        entries = _entries(session, found, pattern, options, output)
        if session.stopping:
            return
        if not entries:
            raise ExpectationNotMet(found.nothing_on(pattern))
        output.table(COLUMNS, [entry.row() for entry in entries], map(asdict, entries))
        if found.refused:
            output.note(
                f"{found.refused} nodes describe themselves at too great a length: left out"
            )
        if not found.answered:
            output.note("the router does not list subscribers: streams on demand were not measured")


@dataclass(frozen=True, slots=True)
class Entry:
    """One key of the list; its fields are those of ``--json``.

    Attributes:
        publishers: Names of nodes, or ``?`` for each session of unknown name.
        subscribers: Number of sessions without ours; None if the router does not tell.
        rate_hz: Messages per second; None if unknown.
    """

    key: str
    type: str
    encoding: str
    publishers: tuple[str, ...]
    subscribers: int | None
    state: State
    rate_hz: float | None

    def row(self) -> list[object]:
        """Return its row of the table."""
        rate: str = self.state
        if self.state == "flowing":
            rate = "~1" if self.rate_hz is None else f"{self.rate_hz:.1f}"
        publishers = ", ".join(self.publishers) or None
        return [self.key, self.type, self.encoding or None, publishers, self.subscribers, rate]


def _entries(
    session: ToolSession,
    found: Discovery,
    pattern: str,
    options: ListOptions,
    output: Output | None,
) -> list[Entry]:
    entries = observe(session, found, pattern, options.window, output, everything=options.all_)
    return [each for each in entries if each.state == "flowing" or not options.flowing]


def observe(
    session: ToolSession,
    found: Discovery,
    pattern: str,
    window_s: float,
    output: Output | None,
    *,
    everything: bool = False,
) -> list[Entry]:
    """Measure streams for a while, and return all keys that are known or were seen, in order.

    With ``everything`` subscribe to the pattern itself, even if that starts streams. Keys and
    messages that are left out, since there are too many, are noted in ``output``.
    """
    patterns = [pattern] if everything else _harmless(found, pattern, session.namespace)
    monitor = StreamMonitor(session, patterns)
    window = monitor.measure(window_s)
    monitor.close()
    monitor.update()
    seen: dict[str, list[StreamStatistics]] = {}
    for stream in monitor.streams:
        if intersect(pattern, stream.key):
            seen.setdefault(stream.key, []).append(stream)
    keys, left_out = found.listed(pattern, seen)
    exact, wild = set(patterns), [each for each in patterns if "*" in each]
    entries = []
    for key in keys:
        if session.stopping:
            break
        watched = key in exact or any(intersect(each, key) for each in wild)
        entries.append(_entry(key, found, seen.get(key, []), watched, window))
    if output is not None and left_out:
        output.note(f"{left_out} more keys are left out; name a narrower key expression")
    if output is not None and monitor.left_out:
        output.note(TOO_MANY)
    return entries


def _harmless(found: Discovery, pattern: str, namespace: str) -> list[str]:
    """Return key expressions to which a subscription does not start a stream.

    They are topics that are always published, keys of publishers that are not nodes and so do not
    wait for subscribers, and keys that have a subscriber already.
    """
    patterns = [f"{namespace}/*/{topic.name}" for topic in TOPICS.values() if not topic.lazy]
    patterns += list(found.subscribers)[:MAX_KEYS]
    for key in found.listed(pattern)[0]:
        topic = topic_of(key)
        if topic is None or not topic.lazy or found.others_publish(key):
            patterns.append(key)
    return [each for each in patterns if intersect(pattern, each)]


def _entry(
    key: str,
    found: Discovery,
    streams: Sequence[StreamStatistics],
    watched: bool,
    window: tuple[float, float],
) -> Entry:
    topic = topic_of(key)
    names = sorted({*found.nodes_publishing(key), *(each.node for each in streams if each.node)})
    unnamed = max(0, found.publisher_count(key) - len(names))
    encoding = streams[-1].encoding if streams else topic.encoding if topic else ""
    state: State = "on demand"
    rate_hz = None
    if streams:
        state = "flowing"
        rate_hz = rate_of_parts([stream.samples for stream in streams], *window)
        rate_hz = None if rate_hz is None else round(rate_hz, 3)
    elif watched:
        state, rate_hz = "silent", 0.0
    return Entry(
        key,
        type_of(encoding),
        encoding,
        (*names, *["?"] * unnamed),
        found.subscriber_count(key),
        state,
        rate_hz,
    )
