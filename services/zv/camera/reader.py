"""Reads one opening of a source, which is one epoch, on a thread of its own."""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Iterator
from contextlib import closing, contextmanager
from dataclasses import dataclass
from typing import Literal

from zenoh_vision.config.revisions import ParameterStore, Revision
from zenoh_vision.errors import SourceError, SourceLost
from zenoh_vision.host import abandoned_threads
from zenoh_vision.image.picture import Picture
from zenoh_vision.messages import Track
from zenoh_vision.stream.buffer import Buffer
from zenoh_vision.stream.counters import FrameCounters
from zv.camera import source_policy
from zv.camera.frame_filter import FrameFilter
from zv.camera.lag import LagMonitor
from zv.camera.pacing import PictureTimer
from zv.camera.settings import CameraSettings
from zv.camera.source_policy import OpenSource
from zv.camera.sources.base import HasControls, KnowsNextDue, Source, TimedPicture
from zv.camera.sources.kinds import Kind

log = logging.getLogger(__name__)

State = Literal["opening", "reading", "ended", "lost", "failed"]


@dataclass(frozen=True, slots=True)
class CapturedFrame:
    """A picture with the identity under which it will be published.

    Its revision has the settings with which it was read and will be converted. ``replay`` is set
    for a frame that is not shown at its time: when reading began, ns since 1970.
    """

    picture: Picture
    truth: tuple[Track, ...] | None
    epoch: int
    seq: int
    stamp_ns: int
    revision: Revision[CameraSettings]
    replay: int | None = None


class SourceReader:
    """Opens a source and reads it until it ends, is lost, or is abandoned.

    Opening and reading may block forever, so both run on a thread that can be abandoned: after
    ``abandon`` it puts no more frames into the buffer. A change of the parameters takes effect
    with the next picture.

    Attributes:
        state: ``failed`` if it could not be opened; ``lost`` if reading failed later.
        reason: Why it failed or was lost.
        description: Description of the source; empty until it is open.
        live: Whether the source paces itself; False until it is open.
        captured: Number of captured frames.
        opened_with: The settings with which it is opened.
        timer: Paces the reading; it is notified of changes of the parameters.
        lag: How far its pictures are behind their capture.
    """

    def __init__(
        self,
        open_source: OpenSource,
        *,
        parameters: ParameterStore[CameraSettings],
        kind: Kind,
        epoch: int,
        buffer: Buffer[CapturedFrame],
        counters: FrameCounters,
    ) -> None:
        self.epoch = epoch
        self.state: State = "opening"
        self.reason = ""
        self.description = ""
        self.live = False
        self.captured = 0
        self._open_source = open_source
        self._parameters = parameters
        self.opened_with = parameters.newest.settings
        self._read_with = parameters.newest
        self._kind = kind
        self._watched = source_policy.is_watched_for_repeats(kind)
        self._buffer = buffer
        self._counters = counters
        self._may_read = threading.Event()
        self._source: Source | None = None
        self.timer = PictureTimer(self._rate_hz)
        self.timer.blocked_since_s = time.monotonic()
        self._filter = FrameFilter()
        self.lag = LagMonitor()
        self._thread = threading.Thread(target=self._run, name=f"source {epoch}", daemon=True)

    def open(self) -> None:
        """Begin to open the source, on the thread."""
        self._thread.start()

    @property
    def closed(self) -> bool:
        """Whether the thread has ended, and with it the source is closed."""
        return not self._thread.is_alive()

    def needs_reopening(self, newest: CameraSettings) -> bool:
        """Tell whether the source must be opened again to follow other settings."""
        source_hz = None if self._source is None else self._source.rate_hz
        return source_policy.needs_reopening(self._kind, self.opened_with, newest, source_hz)

    @property
    def still_s(self) -> float:
        """How long the pictures of a live source have been equal, seconds."""
        return self._filter.still_s if self.state == "reading" else 0.0

    def start_reading(self) -> None:
        """Let the thread put pictures into the buffer; a live source's earlier ones are lost.

        None is lost if this is called before ``open``.
        """
        self._may_read.set()

    def abandon(self) -> None:
        """Abandon the thread; it closes the source as soon as it can."""
        abandoned_threads.abandon(self._thread)
        self.timer.stop()
        self._may_read.set()

    def join(self, timeout_s: float) -> None:
        """Wait for the thread to end, and with it for the source to be closed."""
        self._thread.join(timeout_s)

    def _run(self) -> None:
        try:
            self._open_and_read()
        finally:
            self._source = None  # the timer's reference to this reader would keep its memory

    def _open_and_read(self) -> None:
        try:
            source = self._source = self._open_source(self.opened_with, self._current_settings)
        except Exception as error:  # a driver may raise anything, and must not fail silently
            self._fail("failed", error)
            return
        self.description, self.live = source.description, source.live
        self.timer.blocked_since_s = None
        self.state = "reading"
        try:
            with closing(source), self._parameters_of(source):
                try:
                    self._read(source)
                except Exception as error:
                    self.reason = _reason_of(error)  # closing may take longer than is waited for
                    raise
        except Exception as error:
            log.debug("reading failed", exc_info=True)
            self._fail("lost", error)
        else:
            self.state = "ended"

    @contextmanager
    def _parameters_of(self, source: Source) -> Iterator[None]:
        """Make the controls of a source parameters of the node."""
        if not isinstance(source, HasControls):
            yield
            return
        self._parameters.add(source.controls)
        try:
            yield
        finally:
            self._parameters.remove(source.controls)

    def check(self, settings: CameraSettings) -> None:
        """Refuse settings that the open source cannot follow.

        Raises:
            ParameterRefused: It does not offer them.
        """
        if self.state == "reading" and settings is not self.opened_with:
            source_policy.check_change(self._kind, self._source, settings)

    def _fail(self, state: State, error: Exception) -> None:
        self.reason = _reason_of(error)
        self.state = state

    def _current_settings(self) -> CameraSettings:
        """Return the newest settings that this opening can follow, and read with them from now on.

        Raises:
            SourceLost: The source was abandoned; this also ends a long call of the source.
        """
        if self.timer.stopped:
            raise SourceLost("abandoned")
        newest = self._parameters.newest
        if newest is not self._read_with and source_policy.same_source(
            self._kind, self.opened_with, newest.settings
        ):
            self._read_with = newest
        return self._read_with.settings

    def _read(self, source: Source) -> None:
        # Asked once, since it costs as much as all else that is done here for a picture.
        due_s = source.next_due_s if isinstance(source, KnowsNextDue) else None
        if not source.live:
            self._may_read.wait()
        while not self.timer.stopped:
            self.timer.rest()
            self.timer.blocked_since_s = time.monotonic()
            self._current_settings()
            if due_s is not None and not self.timer.wait_until(due_s):
                return
            read = source.read()
            self.timer.blocked_since_s = None
            if read is None:
                if self.captured and not source.live:
                    self.timer.wait_after_last(1.0 / (self._rate_hz() or source.rate_hz or 10.0))
                return
            if source.live and not self._takes(source, read):
                continue
            if read.due_s is not None and not self.timer.wait_for_picture(read.due_s):
                return
            self._hand_over(read)

    def _takes(self, source: Source, read: TimedPicture) -> bool:
        """Tell whether a picture of a live source is wanted; count those lost or skipped before."""
        if not self._may_read.is_set():
            # It must not wait in a buffer of the driver or the network, and be published later
            # with the time of its reading.
            return False
        # Also of one that the rate leaves out: how far the source lags does not depend on it.
        now_s = time.monotonic()
        if read.stamp_ns is not None:
            age_s = (time.time_ns() - read.stamp_ns) / 1e9
            self.lag.note(now_s, age_s, read.skipped, read.packets_lost)
        if read.packets_lost:
            self._counters.note("packets_lost", read.packets_lost)
        if read.skipped:
            self._count_missing(read.skipped, "lagging")
        rate_hz = self._parameters.newest.settings.rate
        if not self._filter.allow(rate_hz, now_s):
            return False
        if read.lost and (rate_hz is None or rate_hz >= (source.rate_hz or 0.0)):
            self._count_missing(read.lost, "at_source")
        return True

    def _rate_hz(self) -> float | None:
        return source_policy.imposed_rate(self._kind, self._parameters.newest.settings)

    def _count_missing(self, amount: int, reason: str) -> None:
        """Count pictures that the source took and did not deliver; they have numbers too."""
        self.captured += amount
        self._counters.arrive(amount)
        self._counters.drop(reason, amount)

    def _hand_over(self, read: TimedPicture) -> None:
        stamp_ns = read.stamp_ns or time.time_ns()
        if self.timer.stopped:
            return
        newest, revision = self._parameters.newest, self._read_with
        # A picture that was read before a change, and would differ after it, keeps its revision.
        if newest is not revision and source_policy.same_picture(
            self._kind, revision.settings, newest.settings
        ):
            revision = newest
        seq, self.captured = self.captured, self.captured + 1
        self._counters.arrive()
        if self._watched and self._filter.is_repeat(read.picture, time.monotonic()):
            if newest.settings.skip_repeats:
                self._counters.drop("repeated")
                return
            self._counters.note("repeated")
        captured = CapturedFrame(read.picture, read.truth, self.epoch, seq, stamp_ns, revision)
        self._buffer.put(captured)


def _reason_of(error: Exception) -> str:
    expected = isinstance(error, SourceError)
    return str(error) if expected else f"{type(error).__name__}: {error}"
