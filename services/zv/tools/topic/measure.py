"""``zv topic hz``, ``bw`` and ``delay``: measure streams until Ctrl-C, or check them once."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import pairwise
from statistics import fmean
from typing import Any

from zenoh_vision.errors import ExpectationNotMet
from zenoh_vision.topics import COMPRESSED
from zenoh_vision.transport.connection import Connection
from zv.status.display import Display
from zv.tools.shared.discovery import discover, intersect, waiting_for
from zv.tools.shared.output import Output, view_of
from zv.tools.shared.session import ToolSession, key_expression
from zv.tools.topic.options import BwOptions, DelayOptions, HzOptions
from zv.tools.topic.statistics import SPREAD, StreamMonitor, StreamStatistics, rate_of, spread

PERIOD_S = 1.0
SILENT_S = 2.0
FORGET_S = 10.0
"""A stream that is silent for this long is no longer shown."""

TOO_MANY = "more streams or messages come than can be kept: some are left out"

PLACES = 2
JSON_PLACES = 6


@dataclass(frozen=True, slots=True)
class Measure:
    """A kind of measurement of a stream: one value, and the spread of samples.

    Attributes:
        title: Title of the value's column, with the unit at its end; the name in JSON is made
            from it.
        scale: Factor from the base unit of expectations (Hz, bytes per second, seconds) to the
            value's unit.
        spread_unit: Unit of the samples and their spread.
        value: Returns the value between two times; None if there is none.
        samples: Returns the samples of the spread.
    """

    title: str
    scale: float
    spread_unit: str
    value: Callable[[StreamStatistics, float, float], float | None]
    samples: Callable[[StreamStatistics], Sequence[float]]

    @property
    def columns(self) -> list[str]:
        """Titles of the table."""
        named = [f"{name} {self.spread_unit}" for name in SPREAD]
        return ["key", "node", self.title, *named, "messages", "lost"]

    def text(self, value: float) -> str:
        """Return a value with its unit."""
        return f"{value:.2f} {self.title.rpartition(' ')[2]}"


def _bandwidth(stream: StreamStatistics, begin_s: float, end_s: float) -> float:
    mean_size = sum(stream.sizes) / max(1, len(stream.sizes))
    return rate_of(stream.times_s, begin_s, end_s) * mean_size / 1e3


HZ = Measure(
    title="rate Hz",
    scale=1.0,
    spread_unit="ms",
    value=lambda stream, begin_s, end_s: rate_of(stream.times_s, begin_s, end_s),
    samples=lambda stream: [(b - a) * 1e3 for a, b in pairwise(stream.times_s)],
)
BANDWIDTH = Measure(
    title="kB/s",
    scale=1e-3,
    spread_unit="kB",
    value=_bandwidth,
    samples=lambda stream: [size / 1e3 for size in stream.sizes],
)
DELAY = Measure(
    title="mean ms",
    scale=1e3,
    spread_unit="ms",
    value=lambda stream, *_: fmean(stream.delays_ms) if stream.delays_ms else None,
    samples=lambda stream: stream.delays_ms,
)


class Measurement:
    """A stream measured between two monotonic times."""

    def __init__(
        self, measure: Measure, stream: StreamStatistics, begin_s: float, end_s: float
    ) -> None:
        self.stream = stream
        self._measure = measure
        self._seconds = end_s - begin_s
        self._value = measure.value(stream, begin_s, end_s)
        self._spread = spread(measure.samples(stream))

    def row(self) -> list[object]:
        """Return the row of the table."""
        stream = self.stream
        return [stream.key, stream.node, *self._values(PLACES), len(stream.times_s), stream.lost]

    def line(self) -> str:
        """Return the measurement as one line of text."""
        stream, measure = self.stream, self._measure
        words = [stream.name, "-" if self._value is None else measure.text(self._value)]
        if self._spread:
            figures = zip(SPREAD, self._values(PLACES)[1:], strict=True)
            named = " ".join(f"{name} {value:g}" for name, value in figures)
            words.append(f"({named} {measure.spread_unit})")
        lost = "" if stream.lost is None else f", {stream.lost} lost"
        return f"{' '.join(words)} {len(stream.times_s)} messages{lost}"

    def record(self) -> dict[str, Any]:
        """Return the measurement for JSON; names carry their unit."""
        stream, gaps = self.stream, self.stream.gaps
        value = self._measure.title.lower().replace(" ", "_").replace("/", "_per_")
        names = [value, *(f"{each}_{self._measure.spread_unit.lower()}" for each in SPREAD)]
        return {
            "key": stream.key,
            "node": stream.node,
            **dict(zip(names, self._values(JSON_PLACES), strict=True)),
            "messages": len(stream.times_s),
            "seconds": round(self._seconds, 3),
            "lost": stream.lost,
            "repeated": gaps.repeated,
            "restarts": gaps.restarts,
        }

    def failures(
        self, expected: float | None, tolerance: float, at_most: float | None
    ) -> Iterator[str]:
        """Yield a text for each expectation that the stream does not meet.

        Args:
            expected: The expected value, in the base unit.
            tolerance: Allowed deviation, as a share of ``expected``.
            at_most: Limit of the p99, in the base unit.
        """
        name, measure, value = self.stream.name, self._measure, self._value
        if value is None:
            yield f"{name}: no delay, since its samples have no header"
            return
        if expected is not None:
            low, high = (expected * measure.scale * (1 + off) for off in (-tolerance, tolerance))
            if not low <= value <= high:
                allowed = f"{measure.text(low)} to {measure.text(high)}"
                yield f"{name}: {measure.text(value)}, expected {allowed}"
        if at_most is not None:
            p99, limit, unit = self._spread["p99"], at_most * measure.scale, measure.spread_unit
            if p99 > limit:
                yield f"{name}: p99 {p99:.2f} {unit}, allowed {limit:g} {unit}"

    def _values(self, places: int) -> list[float | None]:
        """Return the value and its spread, rounded."""
        values = [self._value, *(self._spread.get(name) for name in SPREAD)]
        return [None if value is None else round(value, places) for value in values]


def _run(
    measure: Measure,
    options: HzOptions | BwOptions | DelayOptions,
    connection: Connection,
    output: Output,
) -> None:
    """Measure until Ctrl-C, or once over ``--for``.

    Raises:
        ExpectationNotMet: A stream is not as expected, or there is none.
    """
    patterns = [key_expression(key) for key in options.keys]
    patterns = patterns or [COMPRESSED.key(connection.namespace, "*")]
    at_most = options.at_most if isinstance(options, DelayOptions) else None
    checked = options.expect is not None or at_most is not None
    duration_s = options.for_ or (options.window if checked else None)
    with ToolSession(connection) as session:
        monitor = StreamMonitor(session, patterns)
        if duration_s is None:
            _watch(measure, options.window, session, monitor, patterns, output)
            return
        with output.display() as display:
            found, seconds = _measure_once(measure, duration_s, session, monitor, output)
            _show(display, measure, found)
        if monitor.left_out:
            output.note(TOO_MANY)
        if not session.stopping:
            failures = _silent(session, found, patterns)
            for each in found if checked else ():
                failures += each.failures(options.expect, options.tolerance, at_most)
            if failures:
                raise ExpectationNotMet("; ".join(failures))
        elif checked:
            raise ExpectationNotMet(f"stopped after {seconds:.1f} of {duration_s:g} s: no result")


run_hz = partial(_run, HZ)
run_bw = partial(_run, BANDWIDTH)
run_delay = partial(_run, DELAY)


def _watch(
    measure: Measure,
    window_s: float,
    session: ToolSession,
    monitor: StreamMonitor,
    patterns: Sequence[str],
    output: Output,
) -> None:
    """Show measurements once a second until told to stop."""
    begun_s = time.monotonic()
    connected, explained, cut = True, False, False
    with output.display() as display:
        while session.wait(PERIOD_S):
            now_s = time.monotonic()
            monitor.update()
            if monitor.left_out and not cut:
                cut = True
                output.note(TOO_MANY)
            found = _within(measure, monitor, max(begun_s, now_s - window_s), now_s)
            if connected != session.connected:
                connected = not connected
                output.note(
                    "the router is back" if connected else "the router is gone; waiting for it"
                )
            if connected and not explained and now_s - begun_s >= SILENT_S:
                explained = True
                for silence in _silent(session, found, patterns):
                    output.note(waiting_for(silence))
            _show(display, measure, found)


def _within(
    measure: Measure, monitor: StreamMonitor, begin_s: float, now_s: float
) -> list[Measurement]:
    """Measure the streams over a window, or from their first message on if it is within the window.

    Streams that have ended are skipped.
    """
    found = []
    for stream in monitor.streams:
        newest_s = stream.times_s[-1]
        if now_s - newest_s > max(FORGET_S, now_s - begin_s):
            monitor.forget(stream)
            continue
        stream.drop_before(min(begin_s, newest_s))
        is_older = stream.total > len(stream.times_s)
        since_s = begin_s if is_older else stream.times_s[0]
        found.append(Measurement(measure, stream, since_s, now_s))
    return found


def _measure_once(
    measure: Measure,
    duration_s: float,
    session: ToolSession,
    monitor: StreamMonitor,
    output: Output,
) -> tuple[list[Measurement], float]:
    """Measure each stream from the first message on; also return the duration in seconds."""
    longest_s = session.connection.timeout_s or duration_s
    session.wait(min(SILENT_S, longest_s), until=monitor.received_any)
    if longest_s > SILENT_S and not monitor.received_any() and not session.stopping:
        output.note(f"nothing arrived yet; waiting up to {longest_s:g} s")
        session.wait(longest_s - SILENT_S, until=monitor.received_any)
    begin_s = time.monotonic()
    if monitor.received_any():
        session.wait(duration_s)
    now_s = time.monotonic()
    monitor.update()
    begin_s = min([begin_s, *(stream.times_s[0] for stream in monitor.streams)])
    found = [Measurement(measure, stream, begin_s, now_s) for stream in monitor.streams]
    return found, now_s - begin_s


def _silent(
    session: ToolSession, found: Sequence[Measurement], patterns: Sequence[str]
) -> list[str]:
    """Return the error texts for the patterns under which no stream was found."""
    keys = [each.stream.key for each in found]
    silent = [each for each in patterns if not any(intersect(each, key) for key in keys)]
    if silent and not session.connected:
        return ["the router is gone"]
    known = discover(session) if silent else None
    return [known.nothing_on(pattern) for pattern in silent if known]


def _show(display: Display, measure: Measure, found: Sequence[Measurement]) -> None:
    if found:
        rows = [each.row() for each in found]
        lines = [each.line() for each in found]
        records = [each.record() for each in found]
        display.show(view_of(measure.columns, rows, lines, records))
