"""The black box: keeps the last seconds in memory, and decides what makes them worth writing."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator, Sequence

from zenoh_vision import keys
from zenoh_vision.errors import PayloadError
from zenoh_vision.messages import Diagnostics, Level, TrackEvent
from zv.bag.record import Record
from zv.bag.recorder.plan import LEVELS
from zv.bag.recorder.queue import size_of


class Memory:
    """The records of the last seconds, limited in bytes.

    Attributes:
        shortened: How many seconds were kept at least once the limit of bytes was reached; None
            before.
    """

    def __init__(self, last_s: float, limit_bytes: int) -> None:
        self._last_ns, self._limit = int(last_s * 1e9), limit_bytes
        self._records: deque[Record] = deque()
        self._size = 0
        self.shortened: float | None = None

    @property
    def begin_ns(self) -> int:
        """Just before the first record arrived; 0 without records."""
        return self._records[0].log_time_ns - 1 if self._records else 0

    def add(self, record: Record) -> None:
        """Add a record, and forget those that are too old or too many."""
        self._records.append(record)
        self._size += size_of(record)
        oldest_ns = record.log_time_ns - self._last_ns
        while self._records and self._records[0].log_time_ns < oldest_ns:
            self._size -= size_of(self._records.popleft())
        while len(self._records) > 1 and self._size > self._limit:
            first = self._records.popleft()
            self._size -= size_of(first)
            self.shortened = (record.log_time_ns - first.log_time_ns) / 1e9

    def __iter__(self) -> Iterator[Record]:
        return iter(self._records)


class Triggers:
    """What makes the last seconds worth writing.

    Args:
        on_event: Kinds of track events, or ``KIND:ZONE``; ``*`` is any.
        on_level: Names of levels of health.
        namespace: Of the nodes.
        own: Name of the recorder's own node, whose health triggers nothing.
    """

    def __init__(
        self, on_event: Sequence[str], on_level: Sequence[str], namespace: str, own: str
    ) -> None:
        self._events = [each.partition(":")[::2] for each in on_event]
        self._levels = {LEVELS[each] for each in on_level}
        self._prefix = keys.diagnostics_key(namespace, "")
        self._own = keys.diagnostics_key(namespace, own)
        self._level_of: dict[str, int] = {}
        self._asked: deque[str] = deque()

    def ask(self, reason: str) -> None:
        """Trigger by a command, a signal or a query; safe in a signal handler and on any thread."""
        self._asked.append(reason)

    def asked(self) -> str:
        """Return the reason of a command that was given; empty if none was."""
        return self._asked.popleft() if self._asked else ""

    def reason(self, record: Record) -> str:
        """Return why a record triggers; empty if it does not."""
        try:
            if self._events and record.encoding.endswith(";vision.TrackEvent.v1"):
                return self._event(TrackEvent.from_bytes(record.payload))
            if self._levels and record.key.startswith(self._prefix) and record.key != self._own:
                return self._level(Diagnostics.from_bytes(record.payload))
        except PayloadError:
            pass
        return ""

    def _event(self, event: TrackEvent) -> str:
        zone = event.zone or ""
        for kind, wanted in self._events:
            if kind in ("*", event.event) and wanted in ("", zone):
                return "-".join(filter(None, (event.event, zone)))
        return ""

    def _level(self, health: Diagnostics) -> str:
        before = self._level_of.get(health.node, Level.OK)
        if len(self._level_of) < 10_000:
            self._level_of[health.node] = health.level
        if health.level in self._levels and health.level != before:
            return f"{health.node}-{Level(health.level).name.lower()}"
        return ""
