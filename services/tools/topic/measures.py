"""What ``hz``, ``bw`` and ``delay`` say of a stream: columns, lines, records, and the verdict."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from itertools import pairwise
from typing import Any, ClassVar

from services.tools.topic.arrivals import Stream
from services.tools.topic.figures import Spread, rate_of, spread

KILO = 1e3
SPREAD = ("min", "max", "std", "p50", "p99")
PLACES = 2


class Measure(ABC):
    """One kind of figure.

    Args:
        expected: Of the main figure, in its base unit (Hz, bytes per second, seconds).
        tolerance: How far off it may be, as a share of it.
        at_most: Limit of the p99, in the base unit.
    """

    title: ClassVar[str]
    """Of the main figure's column."""
    unit: ClassVar[str]
    """Of the spread."""

    def __init__(
        self,
        expected: float | None = None,
        tolerance: float = 0.1,
        at_most: float | None = None,
    ) -> None:
        self.expected = expected
        self.tolerance = tolerance
        self.at_most = at_most

    @property
    def judges(self) -> bool:
        """Whether something is expected at all."""
        return self.expected is not None or self.at_most is not None

    @abstractmethod
    def main(self, stream: Stream, begin_s: float, end_s: float) -> float | None:
        """Return the main figure in its base unit; None if the stream does not allow it."""

    @abstractmethod
    def values(self, stream: Stream) -> Sequence[float]:
        """Return what the spread is of, in ``unit``."""

    @abstractmethod
    def shown(self, value: float) -> str:
        """Return a value of the main figure with its unit."""

    @abstractmethod
    def in_title(self, value: float) -> float:
        """Return a value of the main figure in the unit of its column."""

    # Forms

    def columns(self) -> list[str]:
        """Return the titles of the table."""
        named = [f"{name} {self.unit}" for name in SPREAD]
        return ["key", "node", self.title, *named, "messages", "lost"]

    def row(self, stream: Stream, begin_s: float, end_s: float) -> list[object]:
        """Return a stream's row of the table."""
        main, found = self.main(stream, begin_s, end_s), spread(self.values(stream))
        return [
            stream.key,
            stream.node,
            None if main is None else round(self.in_title(main), PLACES),
            *([None] * len(SPREAD) if found is None else _rounded(found)),
            len(stream.times_s),
            stream.lost,
        ]

    def line(self, stream: Stream, begin_s: float, end_s: float) -> str:
        """Return a stream's figures as one line of text."""
        main, found = self.main(stream, begin_s, end_s), spread(self.values(stream))
        words = [stream.key, f"[{'no header' if stream.node is None else stream.node}]"]
        words.append("-" if main is None else self.shown(main))
        if found is not None:
            named = zip(SPREAD, _rounded(found), strict=True)
            words.append(f"({' '.join(f'{name} {value:g}' for name, value in named)} {self.unit})")
        lost = "" if stream.lost is None else f", {stream.lost} lost"
        return f"{' '.join(words)} {len(stream.times_s)} messages{lost}"

    def record(self, stream: Stream, begin_s: float, end_s: float) -> dict[str, Any]:
        """Return a stream's figures for JSON; names carry their unit."""
        main, found = self.main(stream, begin_s, end_s), spread(self.values(stream))
        unit = self.unit.lower()
        figures = {} if found is None else dict(zip(SPREAD, _rounded(found, 6), strict=True))
        return {
            "key": stream.key,
            "node": stream.node,
            self.field(): None if main is None else round(self.in_title(main), 6),
            **{f"{name}_{unit}": figures.get(name) for name in SPREAD},
            "messages": len(stream.times_s),
            "seconds": round(end_s - begin_s, 3),
            "lost": stream.lost,
            "repeated": stream.repeated,
            "restarts": stream.restarts,
        }

    def field(self) -> str:
        """Return the main figure's name in JSON."""
        return self.title.lower().replace(" ", "_").replace("/", "_per_")

    # Verdict

    def complaint(self, stream: Stream, begin_s: float, end_s: float) -> str | None:
        """Return how a stream fails what is expected; None if it does not."""
        main = self.main(stream, begin_s, end_s)
        who = f"{stream.key} [{'no header' if stream.node is None else stream.node}]"
        if main is None:
            return f"{who}: no delay, since its samples carry no header"
        if self.expected is not None:
            low, high = (self.expected * (1 + sign * self.tolerance) for sign in (-1, 1))
            if not low <= main <= high:
                allowed = f"{self.shown(low)} to {self.shown(high)}"
                return f"{who}: {self.shown(main)}, expected {allowed}"
        found = spread(self.values(stream))
        if self.at_most is not None and found is not None:
            limit = self.in_title(self.at_most)
            if found.p99 > limit:
                return f"{who}: p99 {found.p99:.2f} {self.unit}, allowed {limit:g} {self.unit}"
        return None


class Hz(Measure):
    """Messages per second, and the times between them."""

    title = "rate Hz"
    unit = "ms"

    def main(self, stream: Stream, begin_s: float, end_s: float) -> float | None:
        """Return the rate, Hz."""
        return rate_of(stream.times_s, begin_s, end_s)

    def values(self, stream: Stream) -> Sequence[float]:
        """Return the times between messages, ms."""
        times_s = list(stream.times_s)
        return [(b - a) * 1e3 for a, b in pairwise(times_s)]

    def shown(self, value: float) -> str:
        """Return a rate in words."""
        return f"{value:.2f} Hz"

    def in_title(self, value: float) -> float:
        """Return Hz."""
        return value


class Bw(Measure):
    """Bytes per second, and the sizes of the messages."""

    title = "kB/s"
    unit = "kB"

    def main(self, stream: Stream, begin_s: float, end_s: float) -> float | None:
        """Return the bandwidth, bytes per second: the rate times the mean size."""
        mean = sum(stream.sizes) / max(1, len(stream.sizes))
        return rate_of(stream.times_s, begin_s, end_s) * mean

    def values(self, stream: Stream) -> Sequence[float]:
        """Return the payloads' sizes, kB."""
        return [size / KILO for size in stream.sizes]

    def shown(self, value: float) -> str:
        """Return a bandwidth in words."""
        return f"{value / KILO:.2f} kB/s"

    def in_title(self, value: float) -> float:
        """Return kB per second."""
        return value / KILO


class Delay(Measure):
    """Time from capture to arrival here, by the two clocks."""

    title = "mean ms"
    unit = "ms"

    def main(self, stream: Stream, begin_s: float, end_s: float) -> float | None:  # noqa: ARG002
        """Return the mean delay in seconds; None without headers."""
        delays = stream.delays_ms
        return sum(delays) / len(delays) / 1e3 if delays else None

    def values(self, stream: Stream) -> Sequence[float]:
        """Return the delays, ms."""
        return stream.delays_ms

    def shown(self, value: float) -> str:
        """Return a delay in words."""
        return f"{value * 1e3:.2f} ms"

    def in_title(self, value: float) -> float:
        """Return milliseconds."""
        return value * 1e3


def _rounded(found: Spread, places: int = PLACES) -> list[float]:
    values = (found.minimum, found.maximum, found.deviation, found.p50, found.p99)
    return [round(value, places) for value in values]
