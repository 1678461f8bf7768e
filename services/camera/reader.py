"""The thread that reads one open source into the camera's slot; one run of it is one epoch."""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

from common.errors import SourceError, SourceLost
from common.ledger import Ledger
from common.slot import Slot
from services.camera.pacing import Pacer, Thinner
from services.camera.repeats import RepeatWatch
from services.camera.sources.base import Picture, Source

log = logging.getLogger(__name__)

State = Literal["opening", "reading", "ended", "lost", "failed"]


@dataclass(frozen=True, slots=True)
class Captured:
    """A picture with its identity: born here, nothing changes it afterwards."""

    picture: Picture
    epoch: int
    seq: int
    stamp_ns: int


@dataclass(frozen=True, slots=True)
class ReadingRules:
    """How a source is read.

    Attributes:
        rate_hz: Wanted rate; None for the source's own.
        frozen_after_s: When a repeating source counts as frozen; 0 for never, and then equal
            pictures are all passed on.
    """

    rate_hz: float | None = None
    frozen_after_s: float = 0.0


class SourceReader:
    """Opens a source and reads it until it ends, is lost, or is given up.

    Opening and reading may block for ever, so both happen on a thread that can be left behind:
    after ``give_up`` nothing of it reaches the slot any more.

    Args:
        open_source: Opens the source; may raise ``SourceError``.
        epoch: Start of this run, ns since 1970.
        rules: How to read.
        slot: Where captured pictures go.
        ledger: Counts them.
    """

    def __init__(
        self,
        open_source: Callable[[], Source],
        *,
        epoch: int,
        rules: ReadingRules,
        slot: Slot[Captured],
        ledger: Ledger,
    ) -> None:
        self.epoch = epoch
        self.state: State = "opening"
        self.reason = ""
        self.description = ""
        self.live = False
        self.captured = 0
        self.blocked_since_s: float | None = time.monotonic()
        self._open_source = open_source
        self._rules = rules
        self._slot = slot
        self._ledger = ledger
        self._may_read = threading.Event()
        self._given_up = threading.Event()
        self._source: Source | None = None
        self._thread = threading.Thread(target=self._run, name=f"source {epoch}", daemon=True)
        self._thread.start()

    def start_reading(self) -> None:
        """Let the open source be read; until then it waits."""
        self._may_read.set()

    def give_up(self) -> None:
        """Leave the thread behind; it closes the source as soon as it can."""
        self._given_up.set()
        self._may_read.set()

    def join(self, timeout_s: float) -> None:
        """Wait for the thread to end, so that the source is closed."""
        self._thread.join(timeout_s)

    def _run(self) -> None:
        try:
            self._source = self._open_source()
        except SourceError as error:
            self.reason = str(error)
            self.state = "failed"
            return
        except Exception as error:  # a driver's surprise must not end in silence
            self.reason = f"{type(error).__name__}: {error}"
            self.state = "failed"
            return
        self.description = self._source.description
        self.live = self._source.live
        self.blocked_since_s = None
        self.state = "reading"
        self._may_read.wait()
        outcome: tuple[State, str] = ("ended", "")
        try:
            self._read(self._source)
        except SourceLost as error:
            outcome = ("lost", str(error))
        except Exception as error:
            log.debug("reading failed", exc_info=True)
            outcome = ("lost", f"{type(error).__name__}: {error}")
        finally:
            self._source.close()
            self.reason = outcome[1]
            self.state = outcome[0]

    def _read(self, source: Source) -> None:
        pacer = Pacer()
        rate_hz = self._rules.rate_hz
        thinner = Thinner(rate_hz) if source.live and rate_hz else None
        watch = RepeatWatch(self._rules.frozen_after_s) if self._rules.frozen_after_s else None
        count = 0
        due_s = 0.0
        while not self._given_up.is_set():
            self.blocked_since_s = time.monotonic()
            picture = source.read()
            self.blocked_since_s = None
            if picture is None:
                # The last picture too is shown for as long as it lasts.
                period_s = 1.0 / (rate_hz or source.rate_hz or 10.0)
                if count and not source.live:
                    self._given_up.wait(pacer.wait_s(due_s + period_s, time.monotonic()))
                return
            if not source.live and picture.due_s is not None:
                due_s = count / rate_hz if rate_hz else picture.due_s
                if self._given_up.wait(pacer.wait_s(due_s, time.monotonic())):
                    return
            count += 1
            now_s = time.monotonic()
            if thinner is not None and not thinner.lets_through(now_s):
                continue
            self._hand_over(picture, watch, now_s)

    def _hand_over(self, picture: Picture, watch: RepeatWatch | None, now_s: float) -> None:
        stamp_ns = picture.stamp_ns or time.time_ns()
        if self._given_up.is_set():
            return
        seq, self.captured = self.captured, self.captured + 1
        self._ledger.arrive()
        if watch is not None and watch.repeats(picture, now_s):
            self._ledger.drop("repeated")
            if watch.frozen(now_s):
                raise SourceLost("the picture is frozen")
            return
        self._slot.put(Captured(picture, self.epoch, seq, stamp_ns))
