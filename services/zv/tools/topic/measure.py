"""``zv topic hz``, ``bw`` and ``delay``: measure streams until Ctrl-C, or check them once."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

from zenoh_vision.errors import ExpectationNotMet
from zenoh_vision.topics import COMPRESSED
from zenoh_vision.transport.connection import Connection
from zenoh_vision.transport.matching import intersect
from zv.status.display import Display
from zv.tools.shared.discovery import discover, waiting_for
from zv.tools.shared.output import Output, view_of
from zv.tools.shared.session import ToolSession, key_expression
from zv.tools.shared.statistics import (
    SPREAD,
    TOO_MANY,
    Distribution,
    Samples,
    StreamMonitor,
    StreamStatistics,
)
from zv.tools.topic.options import BwOptions, DelayOptions, HzOptions

PERIOD_S = 1.0
SILENT_S = 2.0
GONE_S = 10.0
"""A stream that is silent for this long is not shown until it is back."""

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
        spread: Returns the distribution whose spread is shown.
        spread_scale: Factor from its unit to ``spread_unit``.
    """

    title: str
    scale: float
    spread_unit: str
    value: Callable[[Samples, float, float], float | None]
    spread: Callable[[Samples], Distribution]
    spread_scale: float = 1.0

    @property
    def columns(self) -> list[str]:
        """Titles of the table."""
        named = [f"{name} {self.spread_unit}" for name in SPREAD]
        return ["key", "node", self.title, *named, "messages", "lost"]

    def text(self, value: float) -> str:
        """Return a value with its unit."""
        return f"{value:.2f} {self.title.rpartition(' ')[2]}"


HZ = Measure(
    title="rate Hz",
    scale=1.0,
    spread_unit="ms",
    value=Samples.rate_hz,
    spread=lambda samples: samples.periods_ms,
)
BANDWIDTH = Measure(
    title="kB/s",
    scale=1e-3,
    spread_unit="kB",
    value=lambda samples, *times_s: samples.rate_hz(*times_s) * samples.sizes.mean / 1e3,
    spread=lambda samples: samples.sizes,
    spread_scale=1e-3,
)
DELAY = Measure(
    title="mean ms",
    scale=1e3,
    spread_unit="ms",
    value=lambda samples, *_: samples.delays_ms.mean if samples.delays_ms.count else None,
    spread=lambda samples: samples.delays_ms,
)


class Measurement:
    """Samples of a stream, measured between two monotonic times."""

    def __init__(
        self,
        measure: Measure,
        stream: StreamStatistics,
        samples: Samples,
        begin_s: float,
        end_s: float,
    ) -> None:
        self.stream = stream
        self._measure = measure
        self._messages = samples.count
        self._seconds = end_s - begin_s
        self._value = measure.value(samples, begin_s, end_s)
        self._spread = {
            name: value * measure.spread_scale
            for name, value in measure.spread(samples).spread().items()
        }

    def row(self) -> list[object]:
        """Return the row of the table."""
        stream = self.stream
        return [stream.key, stream.node, *self._values(PLACES), self._messages, stream.lost]

    def line(self) -> str:
        """Return the measurement as one line of text."""
        stream, measure = self.stream, self._measure
        words = [stream.name, "-" if self._value is None else measure.text(self._value)]
        if self._spread:
            figures = zip(SPREAD, self._values(PLACES)[1:], strict=True)
            named = " ".join(f"{name} {value:g}" for name, value in figures)
            words.append(f"({named} {measure.spread_unit})")
        lost = "" if stream.lost is None else f", {stream.lost} lost"
        return f"{' '.join(words)} {self._messages} messages{lost}"

    def record(self) -> dict[str, Any]:
        """Return the measurement for JSON; names carry their unit."""
        stream, gaps = self.stream, self.stream.gaps
        value = self._measure.title.lower().replace(" ", "_").replace("/", "_per_")
        names = [value, *(f"{each}_{self._measure.spread_unit.lower()}" for each in SPREAD)]
        return {
            "key": stream.key,
            "node": stream.node,
            **dict(zip(names, self._values(JSON_PLACES), strict=True)),
            "messages": self._messages,
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
        monitor = StreamMonitor(session, patterns, moving=duration_s is None)
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
    begun_s = session.clock()
    connected, explained, cut = True, False, False
    with output.display() as display:
        while session.wait(PERIOD_S):
            now_s = session.clock()
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

    Streams that are silent are skipped. They go on where they were, with what was lost meanwhile.
    """
    found = []
    recent, begin_s = monitor.within(begin_s)
    for stream in monitor.streams:
        total = stream.samples
        if now_s - total.last_s > max(GONE_S, now_s - begin_s):
            if monitor.is_full:
                monitor.forget(stream)
            continue
        samples = recent.get(stream, Samples())
        since_s = max(begin_s, total.first_s)
        found.append(Measurement(measure, stream, samples, since_s, now_s))
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
    begin_s, now_s = monitor.measure(duration_s if monitor.received_any() else 0.0)
    monitor.update()
    begin_s = min([begin_s, *(stream.samples.first_s for stream in monitor.streams)])
    found = [
        Measurement(measure, stream, stream.samples, begin_s, now_s) for stream in monitor.streams
    ]
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
