"""Keeps a source open: supervises its reader, and opens the source again after failures."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable, Iterator
from typing import Self

from zenoh_vision.config.revisions import Change, ParameterStore
from zenoh_vision.errors import SourceError
from zenoh_vision.host.backoff import Backoff
from zenoh_vision.stream.buffer import Buffer, latest
from zenoh_vision.stream.counters import FrameCounters
from zv.camera.reader import CapturedFrame, SourceReader
from zv.camera.settings import CameraSettings
from zv.camera.source_policy import OpenSource, SourceOpener
from zv.camera.sources.kinds import kind_of, source_words

log = logging.getLogger(__name__)

POLL_S = 0.05
LOOK_S = 0.2
"""How often it is looked whether a source that delivers is still, lags or loses packets."""

OPEN_POLL_S = 0.005
JOIN_S = 0.3
CLOSE_S = 2.0
"""Time for a source to close before it is reopened with other settings: devices are exclusive."""
STILL = (
    "the picture has not changed for over {:g} s: a screen or a scene without sensor noise, "
    "a covered lens, or a camera that repeats itself"
)
MAX_ABANDONED = 2
"""Largest number of abandoned readers that are still in a call. Each holds the memory of its
source, so the source is opened again only when there are fewer."""
STUCK = "earlier openings of the source have not ended; waiting for one of them"
STUCK_S = 10.0
"""Time for one of them to end; then the process ends, and what supervises it starts it again."""
STUCK_FOR_GOOD = (
    "two readers are stuck in its driver or library, which only the end of the process frees"
)
MARGIN_S = 1.0
"""Time beyond ``stall_after`` in which a source with its own time-out can report why it failed."""


class Capture:
    """Yields the newest picture of a source, and opens the source again when it fails.

    Each opening is a new epoch. A source that stalls or is lost, and a live source that ends, is
    opened again after ``reopen_min`` seconds; the delay doubles up to ``reopen_max``
    until a picture arrives. A source that cannot follow a change of the settings is opened again
    at once. At most ``MAX_ABANDONED`` readers are left behind in a call that does not end.

    Attributes:
        ended: A text that says that the source has ended normally; empty before.

    Raises:
        SourceError: The settings name no source.
    """

    def __init__(
        self,
        parameters: ParameterStore[CameraSettings],
        counters: FrameCounters,
        open_source: OpenSource | None = None,
    ) -> None:
        self._parameters = parameters
        settings = self._settings
        self._shown = source_words(settings.source)
        self.kind = kind_of(settings.source)
        self._counters = counters
        self._buffer = Buffer[CapturedFrame](latest, lambda _: counters.drop("overwritten"))
        self._open_source = open_source or SourceOpener()
        self._reader: SourceReader | None = None
        self._epoch = 0
        self._backoff = Backoff(settings.reopen_min, settings.reopen_max)
        self._reopen_at_s: float | None = None
        self._closing: SourceReader | None = None
        self._abandoned: list[SourceReader] = []
        self._failure = ""
        self._stuck_since_s = 0.0
        self._described = ""
        self._remarked: set[str] = set()
        self._looked_s = 0.0
        self.ended = ""
        parameters.watch(self._on_change)
        parameters.check(self._check)

    @property
    def _settings(self) -> CameraSettings:
        return self._parameters.newest.settings

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_error: object) -> None:
        """Close the source; the thread of a stuck source ends with the process."""
        if self._reader is not None:
            self._reader.abandon()
            self._reader.join(JOIN_S)

    def lag_ms(self) -> float | None:
        """Return how old the source's newest picture was when it came; None if that is unknown."""
        return None if self._reader is None else self._reader.lag.newest_ms(time.monotonic())

    def open(self) -> str:
        """Open the source for the first time, and return its description.

        Raises:
            SourceError: It cannot be opened, or does not answer within ``stall_after``.
        """
        reader = self._start_reader(may_read=False)
        while reader.state == "opening":
            time.sleep(OPEN_POLL_S)
            if self._stalled(reader):
                reader.abandon()
                raise SourceError(f"{self._shown}: not open after {self._settings.stall_after:g} s")
        if reader.state == "failed":
            raise SourceError(reader.reason)
        return reader.description

    def frames(
        self,
        stopping: Callable[[], bool],
        report: Callable[[str], None],
        remark: Callable[[str, str], None],
    ) -> Iterator[CapturedFrame]:
        """Yield the newest frame each time, until told to stop or the source ends normally.

        Args:
            stopping: Returns whether to end.
            report: Called with each failure, and with an empty text when frames arrive again.
            remark: Called with the name of a condition of a source that goes on delivering, and
                what is the matter; with an empty text when it is over.

        Raises:
            SourceError: The source ended without a single picture, or earlier openings of it do
                not end.
        """
        reader = self._reader or self._start_reader()
        reader.start_reading()
        while not stopping():
            captured = self._buffer.take(POLL_S)
            if (newest := self._parameters.newest.settings) is not reader.opened_with:
                self._follow(newest, reader)
            if time.monotonic() - self._looked_s >= LOOK_S:
                self._look(reader, remark)
            if captured is None:
                if not self._supervise(reader, report):
                    return
                reader = self._reader or reader
            elif captured.epoch != reader.epoch:
                self._counters.drop("given_up")
            else:
                if reader.description != self._described:
                    self._described = reader.description
                    log.info("%s", reader.description)
                if self._failure:
                    self._failure = ""
                    self._backoff.reset()
                    report("")
                yield captured

    def _look(self, reader: SourceReader, remark: Callable[[str, str], None]) -> None:
        """Remark on the conditions of the source that have begun or ended."""
        self._looked_s = now_s = time.monotonic()
        settings, lag = self._settings, reader.lag
        limit_s = settings.frozen_after
        found = {
            "still": STILL.format(limit_s) if limit_s and reader.still_s >= limit_s else "",
            "lag": lag.words(now_s, settings.max_lag),
            "loss": lag.loss_words(now_s),
        }
        for condition, words in found.items():
            if bool(words) != (condition in self._remarked):
                self._remarked ^= {condition}
                remark(condition, words)

    def _supervise(self, reader: SourceReader, report: Callable[[str], None]) -> bool:
        """Act on the reader's state; return False at the normal end of the source."""
        if self._reopen_at_s is not None:
            self._reopen_if_due(self._reopen_at_s, report)
        elif reader.state == "ended":
            if not reader.captured:
                raise SourceError(f"{self._shown}: ended without a single picture")
            if reader.live:
                self._reopen_later("the source ended", report)
            elif not self._settings.loop:
                self.ended = f"{self._shown} ended after {reader.captured} frames"
                return self._buffer.filled  # the last picture is still to be published
            elif not self._buffer.filled:
                self._start_reader()
        elif reader.state in ("lost", "failed"):
            self._reopen_later(reader.reason, report)
        elif self._stalled(reader):
            self._abandon(reader)
            doing = "opening" if reader.state == "opening" else "no picture"
            silent = f"{doing} for {self._settings.stall_after:g} s"
            self._reopen_later(reader.reason or silent, report)
        return True

    def _reopen_if_due(self, at_s: float, report: Callable[[str], None]) -> None:
        self._abandoned = [each for each in self._abandoned if not each.closed]
        closed = self._closing is not None and self._closing.closed
        if not closed and time.monotonic() < at_s:
            return
        most = 1 if self.kind == "synthetic" else MAX_ABANDONED  # a scene's readers always end
        if len(self._abandoned) < most:
            self._reopen_at_s = self._closing = None
            self._start_reader()
        elif self._failure != STUCK:
            self._failure = STUCK
            self._stuck_since_s = time.monotonic()
            report(STUCK)
        elif self.kind != "synthetic" and self._stuck_for_s > STUCK_S:
            raise SourceError(f"{self._shown}: {STUCK_FOR_GOOD}")

    @property
    def _stuck_for_s(self) -> float:
        return time.monotonic() - self._stuck_since_s

    def _check(self, settings: CameraSettings) -> None:
        """Refuse settings that the open source cannot follow; on any thread."""
        if self._reader is not None:
            self._reader.check(settings)

    def _on_change(self, _change: Change[CameraSettings]) -> None:
        """Pass a change on to a reader that waits until a picture is due; on any thread."""
        if self._reader is not None:
            self._reader.timer.settings_changed()

    def _follow(self, settings: CameraSettings, reader: SourceReader) -> None:
        """Abandon a source that cannot follow settings; it is reopened once it is closed."""
        if self._closing is not reader and reader.needs_reopening(settings):
            log.info("opening %s again for the new settings", self._shown)
            self._abandon(reader)
            self._closing = reader
            self._reopen_at_s = time.monotonic() + CLOSE_S
            self._backoff.reset()

    def _abandon(self, reader: SourceReader) -> None:
        reader.abandon()
        self._abandoned.append(reader)

    def _stalled(self, reader: SourceReader) -> bool:
        """Tell whether opening or reading has taken too long."""
        since_s = reader.timer.blocked_since_s
        margin_s = MARGIN_S if reader.state == "opening" or self.kind != "synthetic" else 0.0
        allowed_s = self._settings.stall_after + margin_s
        return since_s is not None and time.monotonic() - since_s > allowed_s

    def _reopen_later(self, reason: str, report: Callable[[str], None]) -> None:
        settings, backoff = self._settings, self._backoff
        backoff.first_s, backoff.longest_s = settings.reopen_min, settings.reopen_max
        delay_s = backoff.next_delay_s()
        self._reopen_at_s = time.monotonic() + delay_s
        self._failure = f"{reason}; opening {self._shown} again in {delay_s:g} s"
        report(self._failure)

    def _start_reader(self, *, may_read: bool = True) -> SourceReader:
        self.ended = ""
        self._epoch = max(self._epoch + 1, time.time_ns())
        self._reader = SourceReader(
            self._open_source,
            parameters=self._parameters,
            kind=self.kind,
            epoch=self._epoch,
            buffer=self._buffer,
            counters=self._counters,
        )
        if may_read:
            self._reader.start_reading()
        self._reader.open()
        return self._reader
