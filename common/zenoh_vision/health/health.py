"""The health of a node: one level from counters, rates, drops, inputs and the service's report."""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Iterator
from typing import Any

from zenoh_vision.errors import PayloadError
from zenoh_vision.health.latency import LatencyMonitor
from zenoh_vision.health.log_throttle import LogThrottle
from zenoh_vision.health.rate_monitor import RateMonitor
from zenoh_vision.health.silence_log import SILENT_S, SilenceLog
from zenoh_vision.messages import SEVERITY, Diagnostics, Level
from zenoh_vision.stream.counters import FrameCounters
from zenoh_vision.stream.intake import InputState, Intake

STUCK_S = 5.0
"""A loop is stuck if an iteration takes this long: in the work on a frame, or in a device."""

CLOCK_AHEAD_NS = 50_000_000
CLOCK_BEHIND_NS = 1_000_000_000


class Health:
    """Collects a node's state and makes its diagnostics; safe between threads.

    Attributes:
        namesake: The complaint about another node of the same name; empty if there is none.
        remark: A note about something intended, such as reduced quality; empty if there is none.
        shared_memory: Why frames cannot go through shared memory although they should; empty if
            they can.
    """

    def __init__(self, node: str, counters: FrameCounters) -> None:
        self.latency = LatencyMonitor()
        self.rates = RateMonitor(counters.arrived)
        self.namesake = ""
        self.remark = ""
        self.shared_memory = ""
        self._node = node
        self._counters = counters
        log = logging.getLogger(node)
        self._log_throttle = LogThrottle(log)
        self._silence_log = SilenceLog(log)
        self._report: tuple[int, str] = (Level.OK, "")
        self._loop_alive_s: float | None = None
        self._started_s = time.monotonic()
        self._inputs: list[Intake[Any, Any]] = []
        self._lock = threading.Lock()

    @property
    def inputs(self) -> list[Intake[Any, Any]]:
        """The open inputs; those of frames are watched for silence and late frames."""
        with self._lock:
            return list(self._inputs)

    def watch(self, watched: Intake[Any, Any]) -> None:
        """Begin to watch an input."""
        with self._lock:
            self._inputs.append(watched)

    def unwatch(self, watched: Intake[Any, Any]) -> None:
        """Stop watching an input."""
        with self._lock:
            self._inputs.remove(watched)

    def report(self, level: int, message: str) -> None:
        """Set the level and message of the service itself, until its next report."""
        self._report = (level, message)

    def loop_alive(self) -> None:
        """Record that the service's loop begins an iteration."""
        self._loop_alive_s = time.monotonic()

    def done(self, stamp_ns: int | None) -> None:
        """Record that an item is done, and its latency since the capture if that is known."""
        latency_ms = None if stamp_ns is None else (time.time_ns() - stamp_ns) / 1e6
        self.latency.note(time.monotonic(), latency_ms)

    def log_drop(self, error: PayloadError) -> None:
        """Log a drop, once per burst."""
        self._log_throttle.note(error, time.monotonic())

    def failure(self) -> str:
        """Return why the node cannot work: a stuck loop, a lost source; empty if it can.

        Diagnostics report more than this as an error or as stale. A node without input has nothing
        to do, which is no failure.
        """
        level, message = self._report
        return "; ".join(filter(None, (self._stuck(), message if level == Level.ERROR else "")))

    def diagnostics(self) -> Diagnostics:
        """Return the health at this moment; the counters in it balance."""
        # Read together: the node's start can be computed from the time and the uptime.
        now_s, stamp_ns = time.monotonic(), time.time_ns()
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
            transport=self._transport(),
        )

    def _transport(self) -> str | None:
        """Return how the frames of all inputs come; None before the first."""
        states = [state for watched in self.inputs for state in watched.states()]
        return ",".join(sorted({state.way for state in states if state.way})) or None

    def _stuck(self) -> str:
        alive_s = self._loop_alive_s
        since_s = 0.0 if alive_s is None else time.monotonic() - alive_s
        return f"the loop has been stuck for {since_s:.0f} s" if since_s > STUCK_S else ""

    def _judge(self, now_s: float, wall_ns: int, counters: dict[str, int]) -> tuple[int, str]:
        """Return the most serious level, and all messages."""
        found: list[tuple[int, str]] = [self._report, (Level.OK, self.remark)]
        warnings = [self.namesake, self.shared_memory, *(each.fault for each in self.inputs)]
        found += [(Level.WARN, words) for words in warnings if words]
        if stuck := self._stuck():
            found.append((Level.ERROR, stuck))
        if self._report[0] == Level.OK:
            found += [(Level.WARN, words) for words in self.rates.judge(now_s, counters)]
        else:  # a low rate that follows from the service's report is not reported
            self.rates.restart()
        states = [state for watched in self.inputs for state in watched.states()]
        self._silence_log.note(states, now_s)
        for state in states:
            found += _input_findings(state, now_s, wall_ns)
        reasons = self._log_throttle.current()
        if reasons:
            found.append((Level.WARN, f"dropping samples: {', '.join(reasons)}"))
        worst = max((level for level, _ in found), key=lambda level: SEVERITY[level])
        return int(worst), "; ".join(message for _, message in found if message) or "ok"


def _input_findings(state: InputState, now_s: float, wall_ns: int) -> Iterator[tuple[int, str]]:
    silent_s = now_s - state.since_ns / 1e9
    late_s = 0.0 if state.late_since_ns is None else now_s - state.late_since_ns / 1e9
    if silent_s > SILENT_S:
        yield Level.STALE, f"no frame on {state.key} for {silent_s:.0f} s"
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
    # More than a frame can take is a difference of two clocks. That is normal, but latencies are
    # wrong by as much, so it is reported.
    if not -CLOCK_AHEAD_NS < offset_ns < CLOCK_BEHIND_NS:
        yield Level.OK, f"the camera's clock is {-offset_ns / 1e9:+.1f} s from this machine's"
