"""What a node knows of its own health, and the message that says so once a second."""

from __future__ import annotations

import logging
import time

from common.bounds import RateBounds
from common.diagnostics import ERROR, OK, STALE, WARN, Complaints, Pace
from common.errors import PayloadError
from common.ledger import Ledger
from common.messages import Diagnostics
from common.receiving import FrameReceiver

SILENT_S = 2.0
STUCK_S = 5.0
"""A loop that has not come round for so long is stuck: in a frame, or in a device."""

CLOCK_AHEAD_NS = 50_000_000
CLOCK_BEHIND_NS = 1_000_000_000
SEVERITY = {OK: 0, WARN: 1, STALE: 2, ERROR: 3}


class Health:
    """Counters, pace, complaints and the service's own report, judged together.

    Args:
        node: The node's name.
        ledger: Its counters.
    """

    def __init__(self, node: str, ledger: Ledger) -> None:
        self.pace = Pace()
        self.bounds = RateBounds(ledger.arrived)
        self.receivers: list[FrameReceiver] = []
        self._node = node
        self._ledger = ledger
        self._complaints = Complaints(logging.getLogger(node))
        self._report = (OK, "")
        self._turned_s: float | None = None
        self._started_s = time.monotonic()

    def report(self, level: int, message: str) -> None:
        """Set what the service itself knows, until its next report."""
        self._report = (level, message)

    def turn(self) -> None:
        """Take note that the service's loop has come round."""
        self._turned_s = time.monotonic()

    def trouble(self) -> str:
        """Return why no work is done or can be: a stuck loop, a lost source; else nothing.

        Less than what diagnostics call an error or stale: a node to which nothing is sent does
        all the work there is.
        """
        level, message = self._report
        return "; ".join(filter(None, (self._stuck(), message if level == ERROR else "")))

    def _stuck(self) -> str:
        turned_s = self._turned_s
        since_s = 0.0 if turned_s is None else time.monotonic() - turned_s
        return f"the loop has been stuck for {since_s:.0f} s" if since_s > STUCK_S else ""

    def complain(self, error: PayloadError) -> None:
        """Log a drop, once per burst."""
        self._complaints.note(error, time.monotonic())

    def diagnostics(self) -> Diagnostics:
        """Return the health at this moment; the counters in it balance."""
        # Read together: who knows both knows this node's start.
        now_s, stamp_ns = time.monotonic(), time.time_ns()
        self._complaints.settle(now_s)
        counters = self._ledger.snapshot()
        level, message = self._judge(now_s, counters)
        return Diagnostics(
            node=self._node,
            stamp_ns=stamp_ns,
            level=level,
            message=message,
            uptime_s=now_s - self._started_s,
            counters=counters,
            rate_hz=self.pace.rate_hz(now_s),
            latency_ms=self.pace.latency(now_s),
            latency_histogram_ms=self.pace.histogram(),
        )

    def _judge(self, now_s: float, counters: dict[str, int]) -> tuple[int, str]:
        """Return the worst level, and all that there is to say."""
        found = [self._report]
        if stuck := self._stuck():
            found.append((ERROR, stuck))
        if self._report[0] == OK:
            found += [(WARN, words) for words in self.bounds.judge(now_s, counters)]
        else:  # a rate that is low because of that needs no words of its own
            self.bounds.restart()
        for receiver in self.receivers:
            since_s = now_s - (receiver.arrived_s or receiver.begun_s)
            if since_s > SILENT_S:
                found.append((STALE, f"no frame on {receiver.key} for {since_s:.0f} s"))
            elif (late_s := now_s - (receiver.late_since_s or now_s)) > SILENT_S:
                # A queue that drains is late for less. What stays late is a way that got longer
                # than max_age, or stamps that fall behind within the minute that is remembered.
                found.append(
                    (
                        WARN,
                        f"every frame on {receiver.key} for {late_s:.0f} s came too late: "
                        "the way is congested, or a clock is being turned back",
                    )
                )
            offset_ns = receiver.clock_offset_ns
            # What exceeds the time a frame takes is the difference of two clocks: normal, but
            # latencies are wrong by as much, so it is said.
            if offset_ns is not None and not -CLOCK_AHEAD_NS < offset_ns < CLOCK_BEHIND_NS:
                found.append(
                    (OK, f"the camera's clock is {-offset_ns / 1e9:+.1f} s from this machine's")
                )
        reasons = self._complaints.current()
        if reasons:
            found.append((WARN, f"dropping samples: {', '.join(reasons)}"))
        worst = max((level for level, _ in found), key=lambda level: SEVERITY[level])
        return worst, "; ".join(message for _, message in found if message) or "ok"
