"""The health of a node: one level from counters, rates, drops, inputs and reported conditions."""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable, Iterator, Sequence
from typing import Protocol

from zenoh_vision.errors import PayloadError
from zenoh_vision.health.latency import LatencyMonitor
from zenoh_vision.health.log_throttle import SILENT_S, LogThrottle, SilenceLog
from zenoh_vision.health.rate_monitor import RateMonitor
from zenoh_vision.host.clock import SYSTEM_CLOCK, Clock
from zenoh_vision.messages import SEVERITY, Diagnostics, Level
from zenoh_vision.stream.counters import FrameCounters
from zenoh_vision.stream.intake import InputState

STUCK_S = 5.0
"""A loop is stuck if an iteration takes this long: in the work on a frame, or in a device."""

CLOCK_AHEAD_NS = 50_000_000
CLOCK_BEHIND_NS = 1_000_000_000
LONGEST_WAY_NS = 10_000_000_000
"""No link keeps every frame of a minute waiting for longer than this: the buffers are too small."""


MOST_ROUTES = 20
MOST_FINDINGS = 10
"""Limits of what a report says of inputs: one with wildcards may receive 1000 streams, and all
receivers refuse a report that is too large (``message_limits``)."""


class Watched(Protocol):
    """An input whose silence, lateness and faults are part of the health."""

    @property
    def keys(self) -> tuple[str, ...]:
        """The key expressions that it subscribes to now."""

    @property
    def fault(self) -> str:
        """Why its items do not come as they should; empty if they do."""

    def states(self) -> Sequence[InputState]:
        """Return the state of each key whose silence is a fault."""


class Health:
    """Collects a node's state and makes its diagnostics; safe between threads.

    Attributes:
        source_lag_ms: Returns how old the newest picture of a camera's source was when it came;
            None if that is unknown.
        remarks: Functions by condition, each asked for every report what to say at the level OK.
    """

    def __init__(self, node: str, counters: FrameCounters, clock: Clock = SYSTEM_CLOCK) -> None:
        self.latency = LatencyMonitor()
        self.rates = RateMonitor(counters.arrived)
        self._clock = clock
        self._node = node
        self._counters = counters
        log = logging.getLogger(node)
        self._log_throttle = LogThrottle(log)
        self._silence_log = SilenceLog(log)
        self._conditions: dict[str, tuple[int, str]] = {}
        self._loop_alive_ns: int | None = None
        self._started_s = self._now_s()
        self._inputs: list[Watched] = []
        self.source_lag_ms: Callable[[], float | None] = lambda: None
        self.remarks: dict[str, Callable[[], str]] = {}
        self._lock = threading.Lock()

    @property
    def inputs(self) -> list[Watched]:
        """The open inputs; those of frames are watched for silence and late frames."""
        with self._lock:
            return list(self._inputs)

    def watch(self, watched: Watched) -> None:
        """Begin to watch an input."""
        with self._lock:
            self._inputs.append(watched)

    def unwatch(self, watched: Watched) -> None:
        """Stop watching an input."""
        with self._lock:
            self._inputs.remove(watched)

    def _now_s(self) -> float:
        return self._clock.monotonic_ns() / 1e9

    def report(self, condition: str, level: int, message: str = "") -> None:
        """Set the level and message of one condition, until its next report.

        Args:
            condition: Its name, such as ``source``; conditions do not affect each other.
            level: One of ``Level``. OK without a message clears the condition.
            message: For people.

        Raises:
            ValueError: There is no such level.
        """
        # The thread that reports must find nothing else, such as an exception as the message.
        level, message = Level(level), str(message)
        with self._lock:
            if level == Level.OK and not message:
                self._conditions.pop(condition, None)
            else:
                self._conditions[condition] = (level, message)

    def message(self, condition: str) -> str:
        """Return the message of a condition; empty if it is not reported."""
        return self._conditions.get(condition, (Level.OK, ""))[1]

    def loop_alive(self) -> None:
        """Record that the service's loop begins an iteration."""
        self._loop_alive_ns = self._clock.monotonic_ns()

    def done(self, stamp_ns: int | None) -> None:
        """Record that an item is done, and its latency since the capture if that is known."""
        clock = self._clock
        latency_ms = None if stamp_ns is None else (clock.time_ns() - stamp_ns) / 1e6
        self.latency.note(clock.monotonic_ns() / 1e9, latency_ms)

    def log_drop(self, error: PayloadError) -> None:
        """Log a drop, once per burst."""
        self._log_throttle.note(error, self._now_s())

    def failure(self) -> str:
        """Return why the node cannot work: a stuck loop, a lost source; empty if it can.

        Diagnostics report more than this as an error or as stale. A node without input has nothing
        to do, which is no failure.
        """
        errors = [words for level, words in self._reported() if level == Level.ERROR]
        return "; ".join(filter(None, (self._stuck(), *errors)))

    def diagnostics(self) -> Diagnostics:
        """Return the health at this moment; the counters in it balance."""
        # Read together: the node's start can be computed from the time and the uptime.
        now_s, stamp_ns = self._now_s(), self._clock.time_ns()
        self._log_throttle.flush(now_s)
        counters = self._counters.snapshot()
        level, message = self._judge(now_s, stamp_ns, counters)
        return Diagnostics(
            node=self._node,
            stamp_ns=stamp_ns,
            level=level,
            message=message,
            uptime_s=now_s - self._started_s,
            counters=counters,
            rate_hz=self.latency.rate_hz(now_s),
            latency_ms=self.latency.percentiles(now_s),
            latency_histogram_ms=self.latency.histogram(),
            routes=self._routes(),
            source_lag_ms=self.source_lag_ms(),
        )

    def _routes(self) -> dict[str, str] | None:
        """Return how the frames of each input come; None before the first."""
        states = [state for watched in self.inputs for state in watched.states()]
        found = {state.key: str(state.route) for state in states if state.route}
        return dict(sorted(found.items())[:MOST_ROUTES]) or None

    def _stuck(self) -> str:
        alive_ns = self._loop_alive_ns
        since_s = 0.0 if alive_ns is None else self._now_s() - alive_ns / 1e9
        return f"the loop has been stuck for {since_s:.0f} s" if since_s > STUCK_S else ""

    def _reported(self) -> list[tuple[int, str]]:
        """Return level and message of each condition, in the order of their names."""
        remarks = tuple(self.remarks.items())  # another thread may add one
        found = {name: (int(Level.OK), words()) for name, words in remarks}
        with self._lock:
            found |= self._conditions
        return [found[name] for name in sorted(found)]

    def _judge(self, now_s: float, wall_ns: int, counters: dict[str, int]) -> tuple[int, str]:
        """Return the most serious level, and all messages."""
        found: list[tuple[int, str]] = [(Level.OK, ""), *self._reported()]
        is_failing = any(level == Level.ERROR for level, _ in found)
        found += [(Level.WARN, each.fault) for each in self.inputs if each.fault]
        if stuck := self._stuck():
            found.append((Level.ERROR, stuck))
        if is_failing:  # a low rate that follows from a reported error is not reported
            self.rates.restart()
        else:
            found += [(Level.WARN, words) for words in self.rates.judge(now_s, counters)]
        states = [state for watched in self.inputs for state in watched.states()]
        self._silence_log.note(states, now_s)
        is_silent = bool(states) and all(_silent_s(state, now_s) > SILENT_S for state in states)
        silence = Level.STALE if is_silent else Level.WARN
        of_inputs = [
            each for state in states for each in _input_findings(state, now_s, wall_ns, silence)
        ]
        if left_out := len(of_inputs[MOST_FINDINGS:]):
            of_inputs.sort(key=lambda each: -SEVERITY[each[0]])
            of_inputs[MOST_FINDINGS:] = [(Level.OK, f"and {left_out} more of its inputs")]
        found += of_inputs
        reasons = self._log_throttle.current()
        if reasons:
            found.append((Level.WARN, f"dropping samples: {', '.join(reasons)}"))
        worst = max((level for level, _ in found), key=lambda level: SEVERITY[level])
        return int(worst), "; ".join(message for _, message in found if message) or "ok"


def _silent_s(state: InputState, now_s: float) -> float:
    return now_s - state.since_ns / 1e9


def _input_findings(
    state: InputState, now_s: float, wall_ns: int, silent: Level
) -> Iterator[tuple[int, str]]:
    """Yield level and message of what is wrong with an input; ``silent`` is that of silence.

    A node is stale if nothing arrives. One of several cameras that stops leaves the others.
    """
    silent_s = _silent_s(state, now_s)
    late_s = 0.0 if state.late_since_ns is None else now_s - state.late_since_ns / 1e9
    if silent_s > SILENT_S:
        yield silent, f"no frame on {state.key} for {silent_s:.0f} s"
    elif late_s > SILENT_S:
        # Frames that waited in a queue are late for a shorter time. They stay late if the link
        # takes longer than before by over max_age, or if the stamps fall behind by as much within
        # the minute over which the least lateness is kept.
        yield (
            Level.WARN,
            f"every frame on {state.key} for {late_s:.0f} s came too late: "
            "the link is congested, or a clock is being set back",
        )
    if state.offset_ns is None:
        return
    offset_ns = state.offset_ns + wall_ns - int(now_s * 1e9)
    # More than a frame can take is a difference of two clocks, or the time on a congested link.
    # It is reported, since latencies include it.
    if not -CLOCK_AHEAD_NS < offset_ns < CLOCK_BEHIND_NS:
        may_be_link = CLOCK_BEHIND_NS <= offset_ns < LONGEST_WAY_NS
        link = f"frames on {state.key} are late: the link is congested, or " if may_be_link else ""
        yield Level.OK, f"{link}the camera's clock is {-offset_ns / 1e9:+.1f} s from this machine's"
