"""Keeps a source open: watches the reader, opens the source again with growing delay."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable, Iterator
from types import TracebackType
from typing import Self

from common.errors import SourceError
from common.ledger import Ledger
from common.live import Change, LiveSettings
from common.slot import Slot
from services.camera.captured import Captured
from services.camera.choice import Opener, must_reopen, open_by
from services.camera.reader import SourceReader
from services.camera.reopening import Reopening
from services.camera.settings import CameraSettings
from services.camera.sources import kind_of, without_password

log = logging.getLogger(__name__)

POLL_S = 0.05
LAST_S = 0.3
OWN_S = 1.0
"""What a source that ends its own opening in time gets for saying why."""


class Capture:
    """The newest picture of a source, whatever happens to the source.

    Each opening is a new epoch. A source that stalls, freezes, is lost, or ends though it
    should not, is opened again after ``reopen_min`` seconds, doubling up to ``reopen_max``
    until a picture comes. So is one that cannot follow a change of the settings, at once.

    Args:
        live: The camera's settings.
        ledger: Counts what is captured.
        open_source: Opens another source than the settings name.

    Raises:
        SourceError: There is no such source.
    """

    def __init__(
        self,
        live: LiveSettings[CameraSettings],
        ledger: Ledger,
        open_source: Opener | None = None,
    ) -> None:
        self.description = ""
        self._live = live
        self._shown = without_password(self._settings.source)
        self.kind = kind_of(self._settings.source)
        self._ledger = ledger
        self._slot = Slot[Captured](lambda _: ledger.drop("overwritten"))
        self._open_source = open_source or open_by
        self._reader: SourceReader | None = None
        self._epoch = 0
        self._reopening = Reopening()
        self._trouble = ""
        live.watch(self._on_change)

    @property
    def _settings(self) -> CameraSettings:
        return self._live.newest.settings

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        """Close the source, unless it is stuck: its thread then ends with the process."""
        if self._reader is not None:
            self._reader.give_up()
            self._reader.join(LAST_S)

    def open_first(self, stopping: Callable[[], bool] = lambda: False) -> None:
        """Open the source for the first time.

        Raises:
            SourceError: It cannot be opened, or does not answer within ``stall_after``.
        """
        reader = self._start_reader()
        while reader.state == "opening" and not stopping():
            time.sleep(POLL_S / 10)
            if self._stalled(reader):
                reader.give_up()
                raise SourceError(f"{self._shown}: not open after {self._settings.stall_after:g} s")
        if reader.state == "failed":
            raise SourceError(reader.reason)
        self.description = reader.description

    def pictures(
        self,
        poll_s: float,
        stopping: Callable[[], bool],
        report: Callable[[str], None],
    ) -> Iterator[Captured]:
        """Yield the newest picture each time; end when told to stop or at the source's end.

        Args:
            poll_s: How often to look after the source, seconds.
            stopping: Whether to end.
            report: Called with what is wrong when that changes; empty when nothing is.

        Raises:
            SourceError: The source ended without a single picture.
        """
        reader = self._reader or self._start_reader()
        reader.start_reading()
        while not stopping():
            captured = self._slot.take(poll_s)
            self._follow(self._reader or reader)
            reader = self._reader or reader
            if captured is not None:
                if captured.epoch != reader.epoch:
                    self._ledger.drop("given_up")
                    continue
                if self._trouble:
                    self._trouble = ""
                    report("")
                self._reopening.succeeded()
                yield captured
            elif not self._look_after(reader, report):
                return

    def _look_after(self, reader: SourceReader, report: Callable[[str], None]) -> bool:
        """Do what the reader's state asks for; return False at the source's regular end."""
        now_s = time.monotonic()
        if self._reopening.planned:
            if self._reopening.due(now_s):
                self._reopening.begun()
                self._start_reader().start_reading()
            return True
        if reader.state == "ended":
            if not reader.captured:
                raise SourceError(f"{self._shown}: ended without a single picture")
            if reader.live:
                self._lose("the source ended", report)
            elif not self._settings.loop:
                return self._slot.filled  # the last picture is still to be published
            elif not self._slot.filled:
                self._start_reader().start_reading()
        elif reader.state in ("lost", "failed"):
            self._lose(reader.reason, report)
        elif self._stalled(reader):
            reader.give_up()
            doing = "opening" if reader.state == "opening" else "no picture"
            self._lose(f"{doing} for {self._settings.stall_after:g} s", report)
        return True

    def _on_change(self, _change: Change[CameraSettings]) -> None:
        """Let a reader that waits for the next picture's time see the change; on any thread."""
        if self._reader is not None:
            self._reader.look_again()

    def _follow(self, reader: SourceReader) -> None:
        """Leave a source that cannot follow the settings; it is opened again at once."""
        if self._reopening.leaving is reader:
            return
        if not must_reopen(self.kind, reader.opened_with, self._settings, reader.source_hz):
            return
        log.info("opening %s again for the new settings", self._shown)
        reader.give_up()
        self._reopening.plan_at_once(time.monotonic(), reader)

    def _stalled(self, reader: SourceReader) -> bool:
        """Tell whether an opening or reading has taken too long; sources' own time-outs first."""
        since_s = reader.blocked_since_s
        allowed_s = self._settings.stall_after + (OWN_S if reader.state == "opening" else 0.0)
        return since_s is not None and time.monotonic() - since_s > allowed_s

    def _lose(self, reason: str, report: Callable[[str], None]) -> None:
        delay_s = self._reopening.plan(
            time.monotonic(), self._settings.reopen_min, self._settings.reopen_max
        )
        self._trouble = f"{reason}; opening {self._shown} again in {delay_s:g} s"
        report(self._trouble)

    def _start_reader(self) -> SourceReader:
        self._epoch = max(self._epoch + 1, time.time_ns())
        self._reader = SourceReader(
            self._open_source,
            live=self._live,
            kind=self.kind,
            epoch=self._epoch,
            slot=self._slot,
            ledger=self._ledger,
        )
        return self._reader
