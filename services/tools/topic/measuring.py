"""``zv topic hz``, ``bw``, ``delay``: figures, again and again, or once with a verdict."""

from __future__ import annotations

import time
from collections.abc import Sequence

import zenoh

from common.connection import Connection
from common.errors import ExpectationNotMet
from common.keys import IMAGE
from services.tools.output import Output
from services.tools.session import ToolSession, key_expression
from services.tools.survey import survey
from services.tools.topic.arrivals import Arrivals, Stream
from services.tools.topic.measures import Bw, Delay, Hz, Measure
from services.tools.topic.options import BwOptions, DelayOptions, HzOptions, MeasureOptions

PERIOD_S = 1.0
SILENT_S = 2.0
FORGET_S = 10.0
"""A stream that is silent for so long is no longer shown."""


def run_hz(options: HzOptions, connection: Connection, output: Output) -> None:
    """Show or judge rates."""
    run(Hz(options.expect, options.tolerance), options, connection, output)


def run_bw(options: BwOptions, connection: Connection, output: Output) -> None:
    """Show or judge bandwidths."""
    run(Bw(options.expect, options.tolerance), options, connection, output)


def run_delay(options: DelayOptions, connection: Connection, output: Output) -> None:
    """Show or judge delays."""
    run(Delay(options.expect, options.tolerance, options.at_most), options, connection, output)


def run(measure: Measure, options: MeasureOptions, connection: Connection, output: Output) -> None:
    """Measure until Ctrl-C, or once over ``--for``.

    Raises:
        ExpectationNotMet: A stream is not as expected, or there is none.
    """
    default = IMAGE.key(connection.namespace, "*")
    patterns = [key_expression(key) for key in options.keys] or [default]
    duration_s = options.for_ or (options.window if measure.judges else None)
    with ToolSession(connection) as session:
        arrivals = Arrivals(session, patterns)
        if duration_s is None:
            _watch(measure, options.window, session, arrivals, patterns, output)
        else:
            _judge(measure, duration_s, session, arrivals, patterns, output)


# Again and again


def _watch(
    measure: Measure,
    window_s: float,
    session: ToolSession,
    arrivals: Arrivals,
    patterns: Sequence[str],
    output: Output,
) -> None:
    """Show the figures once a second until told to stop."""
    begun_s = time.monotonic()
    watch = _Silence(session, patterns, output)
    with output.board() as board:
        while session.wait(PERIOD_S):
            now_s = time.monotonic()
            arrivals.sort()
            begin_s = max(begun_s, now_s - window_s)
            streams = _shown(arrivals, begin_s, now_s)
            watch.look(streams, now_s)
            if streams:
                timed = [(stream, _since(stream, begin_s)) for stream in streams]
                board.show(
                    measure.columns(),
                    [measure.row(each, since_s, now_s) for each, since_s in timed],
                    [measure.line(each, since_s, now_s) for each, since_s in timed],
                    [measure.record(each, since_s, now_s) for each, since_s in timed],
                )


def _shown(arrivals: Arrivals, begin_s: float, now_s: float) -> list[Stream]:
    """Return the streams in order, each cut to the window, without those that ended."""
    for name, stream in list(arrivals.streams.items()):
        newest_s = stream.times_s[-1]
        if now_s - newest_s > max(FORGET_S, now_s - begin_s):
            del arrivals.streams[name]
        else:
            stream.forget(min(begin_s, newest_s))
    return _ordered(arrivals)


def _since(stream: Stream, begin_s: float) -> float:
    """Return since when a stream is judged: one that began in the window is no slower for it."""
    return begin_s if stream.total > len(stream.times_s) else stream.times_s[0]


def _ordered(arrivals: Arrivals) -> list[Stream]:
    return [stream for _, stream in sorted(arrivals.streams.items(), key=_name)]


def _name(item: tuple[tuple[str, str | None], Stream]) -> tuple[str, str]:
    (key, node), _ = item
    return key, node or ""


class _Silence:
    """Says once what there is when nothing comes, and when the router is gone."""

    def __init__(self, session: ToolSession, patterns: Sequence[str], output: Output) -> None:
        self._session = session
        self._patterns = patterns
        self._output = output
        self._begun_s = time.monotonic()
        self._said = False
        self._gone = False

    def look(self, streams: Sequence[Stream], now_s: float) -> None:
        """Judge what was seen so far."""
        connected = self._session.connected
        if self._gone and connected:
            self._output.note("the router is back")
        if not self._gone and not connected:
            self._output.note("the router is gone; waiting for it")
        self._gone = not connected
        if not streams and connected and not self._said and now_s - self._begun_s > SILENT_S:
            self._said = True
            found = survey(self._session)
            for pattern in self._patterns:
                self._output.note(f"{found.nothing_on(pattern)}; waiting")


# Once


def _judge(
    measure: Measure,
    duration_s: float,
    session: ToolSession,
    arrivals: Arrivals,
    patterns: Sequence[str],
    output: Output,
) -> None:
    """Measure once from the first message on, print, and compare with what is expected."""
    patience_s = session.connection.timeout_s or duration_s
    session.wait(patience_s, until=arrivals.any)
    begin_s = time.monotonic()
    if arrivals.any():
        session.wait(duration_s)
    now_s = time.monotonic()
    arrivals.sort()
    for stream in arrivals.streams.values():
        begin_s = min(begin_s, stream.times_s[0])
    streams = _ordered(arrivals)
    with output.board() as board:
        if streams:
            board.show(
                measure.columns(),
                [measure.row(stream, begin_s, now_s) for stream in streams],
                [measure.line(stream, begin_s, now_s) for stream in streams],
                [measure.record(stream, begin_s, now_s) for stream in streams],
            )
    if session.stopping:
        if measure.judges:
            raise ExpectationNotMet(
                f"stopped after {now_s - begin_s:.1f} of {duration_s:g} s: no verdict"
            )
        return
    _compare(measure, session, streams, patterns, begin_s, now_s)


def _compare(
    measure: Measure,
    session: ToolSession,
    streams: Sequence[Stream],
    patterns: Sequence[str],
    begin_s: float,
    now_s: float,
) -> None:
    keys = [zenoh.KeyExpr(stream.key) for stream in streams]
    silent = [
        pattern
        for pattern in patterns
        if not any(zenoh.KeyExpr(pattern).intersects(key) for key in keys)
    ]
    complaints = []
    if silent and not session.connected:
        complaints.append("the router is gone")
    elif silent:
        found = survey(session)
        complaints += [found.nothing_on(pattern) for pattern in silent]
    if measure.judges:
        complaints += [
            complaint
            for stream in streams
            if (complaint := measure.complaint(stream, begin_s, now_s)) is not None
        ]
    if complaints:
        raise ExpectationNotMet("; ".join(complaints))
