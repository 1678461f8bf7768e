"""The thread that reads one open source into the camera's slot; one run of it is one epoch."""

from __future__ import annotations

import logging
import threading
import time
from typing import Literal

from common.errors import SourceError, SourceLost
from common.ledger import Ledger
from common.live import LiveSettings
from common.slot import Slot
from services.camera.captured import Captured
from services.camera.choice import (
    Opener,
    rate_to_keep,
    same_picture,
    same_source,
    watches_for_repeats,
)
from services.camera.settings import CameraSettings
from services.camera.sieve import Sieve
from services.camera.sources import Kind
from services.camera.sources.base import Foresighted, Picture, Source
from services.camera.timing import Timing

log = logging.getLogger(__name__)

State = Literal["opening", "reading", "ended", "lost", "failed"]


class SourceReader:
    """Opens a source and reads it until it ends, is lost, or is given up.

    Opening and reading may block for ever, so both happen on a thread that can be left behind:
    after ``give_up`` nothing of it reaches the slot any more.

    Args:
        open_source: Opens the source; may raise ``SourceError``.
        live: How to open and read it. A change is in force with the next picture.
        kind: Of the source.
        epoch: Start of this run, ns since 1970.
        slot: Where captured pictures go.
        ledger: Counts them.
    """

    def __init__(
        self,
        open_source: Opener,
        *,
        live: LiveSettings[CameraSettings],
        kind: Kind,
        epoch: int,
        slot: Slot[Captured],
        ledger: Ledger,
    ) -> None:
        self.epoch = epoch
        self.opened_with = live.newest.settings
        self.state: State = "opening"
        self.reason = ""
        self.description = ""
        self.live = False
        self.captured = 0
        self._busy_since_s: float | None = time.monotonic()
        self._open_source = open_source
        self._settings = live
        self._asked = live.newest
        self._kind = kind
        self._slot = slot
        self._ledger = ledger
        self._may_read = threading.Event()
        self._source: Source | None = None
        self._timing = Timing(self._rate_hz)
        self._sieve = Sieve()
        self._thread = threading.Thread(target=self._run, name=f"source {epoch}", daemon=True)
        self._thread.start()

    @property
    def source_hz(self) -> float | None:
        """The open source's own rate; None if it has none, or is not open."""
        return None if self._source is None else self._source.rate_hz

    @property
    def blocked_since_s(self) -> float | None:
        """Since when it is opening or reading, by the monotonic clock; None when it is not."""
        since_s = self._busy_since_s
        return None if since_s is None else self._timing.busy_since_s(since_s)

    @property
    def gone(self) -> bool:
        """Whether the thread has ended, and with it the source is closed."""
        return not self._thread.is_alive()

    def start_reading(self) -> None:
        """Let the open source be read; until then it waits."""
        self._may_read.set()

    def look_again(self) -> None:
        """Take note that the settings have changed: a wait may now be too long."""
        self._timing.look_again()

    def give_up(self) -> None:
        """Leave the thread behind; it closes the source as soon as it can."""
        self._timing.stop()
        self._may_read.set()

    def join(self, timeout_s: float) -> None:
        """Wait for the thread to end, so that the source is closed."""
        self._thread.join(timeout_s)

    def _run(self) -> None:
        try:
            self._source = self._open_source(self.opened_with, self._ask)
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
        self._busy_since_s = None
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

    def _ask(self) -> CameraSettings:
        """Return the newest settings, and remember that what is read from now on knows them.

        Those for which the source must be opened again are for the reader after this one.

        Raises:
            SourceLost: The source was given up: one that still asks need not be left behind.
        """
        if self._timing.stopped:
            raise SourceLost("given up")
        newest = self._settings.newest
        if same_source(self._kind, self.opened_with, newest.settings):
            self._asked = newest
        return self._asked.settings

    def _read(self, source: Source) -> None:
        while not self._timing.stopped:
            self._busy_since_s = time.monotonic()
            self._ask()
            if isinstance(source, Foresighted) and not self._timing.wait(source.next_due_s):
                return
            picture = source.read()
            self._busy_since_s = None
            if picture is None:
                if self.captured and not source.live:
                    self._timing.linger(1.0 / (self._rate_hz() or source.rate_hz or 10.0))
                return
            if source.live:
                rate_hz = self._settings.newest.settings.rate
                if not self._sieve.lets_through(rate_hz, time.monotonic()):
                    continue
            elif picture.due_s is not None and not self._timing.wait_for(picture.due_s):
                return
            self._hand_over(picture)

    def _rate_hz(self) -> float | None:
        return rate_to_keep(self._kind, self._settings.newest.settings)

    def _hand_over(self, picture: Picture) -> None:
        stamp_ns = picture.stamp_ns or time.time_ns()
        if self._timing.stopped:
            return
        newest, now_s = self._settings.newest, time.monotonic()
        # A picture that was read before a change, and would be another after it, is of before.
        same = same_picture(self._kind, self._asked.settings, newest.settings)
        revision = newest if same else self._asked
        seq, self.captured = self.captured, self.captured + 1
        self._ledger.arrive()
        frozen_after_s = newest.settings.frozen_after if watches_for_repeats(self._kind) else 0.0
        if self._sieve.repeats(picture, frozen_after_s, now_s):
            self._ledger.drop("repeated")
            if self._sieve.frozen(now_s):
                raise SourceLost("the picture is frozen")
            return
        self._slot.put(Captured(picture, self.epoch, seq, stamp_ns, revision))
