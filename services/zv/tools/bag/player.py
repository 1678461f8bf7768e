"""Plays records in their pace: pauses, steps, jumps and passes. Sends nothing by itself."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Protocol

from zenoh_vision.host.clock import Clock
from zenoh_vision.host.wakeup import Wakeup
from zv.bag.record import Record
from zv.bag.replay_clock import ReplayClock
from zv.bag.replayed import Pass
from zv.tools.bag.read_ahead import ReadAhead

LONGEST_WAIT_S = 0.25
"""Longest wait without a look at whether to stop."""


class Tape(Protocol):
    """What is played."""

    @property
    def begin_ns(self) -> int:
        """Time of arrival of its first record, ns since 1970."""

    @property
    def end_ns(self) -> int:
        """Time of arrival of its last record, ns since 1970."""

    def before(self, moment_ns: int) -> list[Record]:
        """Return the newest record of each latched key before a moment."""

    def after(self, moment_ns: int) -> Iterator[Record]:
        """Yield the records from a moment on, in the order of their arrival."""


@dataclass(frozen=True, slots=True)
class Wish:
    """How to play from now on.

    Attributes:
        speed: Seconds of the recording in a second; 0: as fast as possible.
        paused: Whether its time stands still.
        steps: Number of steps that were asked for so far: each sends the next frame while paused,
            and what is recorded up to the frame after it.
        position_s: Where to jump, seconds since the beginning; a jump is made when it changes.
        loop: Whether to begin again at the end.
        stay: Whether to stay there instead of ending, and to begin again when not paused any more.
    """

    speed: float = 1.0
    paused: bool = False
    steps: int = 0
    position_s: float = 0.0
    loop: bool = False
    stay: bool = False


class Player:
    """Sends the records of a tape when they are due.

    Args:
        tape: What is played.
        wish: Returns how to play now; asked between two records.
        send: Called with each record and its pass.
        is_frame: Tells which records are frames, by which is stepped.
        stopping: Whether to end.
        clock: Tells the time.
        at_end: Called at the end of a recording at which it stays.
        hold_back: Called with each record and its pass before it is waited for; the record is sent
            after it returns, unless there was a jump, a pause or an end meanwhile.

    Attributes:
        changed: Set when the wish, or ``stopping``, has changed, to end a wait.
        begun: Number of passes that were begun.
    """

    def __init__(
        self,
        tape: Tape,
        wish: Callable[[], Wish],
        send: Callable[[Record, Pass], None],
        is_frame: Callable[[Record], bool],
        stopping: Callable[[], bool],
        clock: Clock,
        at_end: Callable[[], None] = lambda: None,
        hold_back: Callable[[Record, Pass], None] = lambda _record, _pass: None,
    ) -> None:
        self._at_end = at_end
        self._hold_back = hold_back
        self.changed = Wakeup()
        self.begun = 0
        self._tape = tape
        self._wish = wish
        self._send = send
        self._is_frame = is_frame
        self._stopping = stopping
        self._clock = clock
        first = wish()
        self._position_s = first.position_s
        self._steps = first.steps
        self._stepped = False
        self.time = ReplayClock(clock, tape.begin_ns, first.speed, paused=first.paused)
        self._pass = Pass(0, self.time.wall_ns)

    def run(self) -> None:
        """Play until the end, or until told to stop."""
        start_ns = self._tape.begin_ns + round(self._position_s * 1e9)
        while not self._stopping():
            jump_ns = self._play_from(start_ns)
            if jump_ns is not None:
                start_ns = jump_ns
            elif self._wish().loop or self._wish().stay:
                start_ns = self._tape.begin_ns
            else:
                return

    def _play_from(self, start_ns: int) -> int | None:
        """Play one pass; return where the next begins if there was a jump, None at the end."""
        begun_ns = max(self._pass.begun_ns + 1, self._clock.time_ns())
        self._pass = Pass(begun_ns, self.time.wall_ns)
        self.begun += 1
        latched = self._tape.before(start_ns)
        if self.begun > 1 and self._wish().paused:
            self._steps -= 1  # the frame at the place to which one has jumped is sent
        ahead = ReadAhead(self._tape.after(start_ns))
        try:
            record = ahead.next()  # opening takes longer than reading on
            self.time.jump(start_ns)
            for each in latched:
                self._send(each, self._pass)
            while record is not None:
                self._hold_back(record, self._pass)
                jump_ns = self._wait_for(record)
                if jump_ns is not None:
                    return jump_ns
                if self._stopping():
                    return None
                self._send(record, self._pass)
                record = ahead.next()
            return self._wait_at_end()
        finally:
            ahead.close()

    def _wait_for(self, record: Record) -> int | None:
        """Wait until a record is due; return where to jump instead, if so."""
        while not self._stopping():
            jump_ns = self._follow()
            if jump_ns is not None:
                return jump_ns
            wait_s = self.time.wait_s(record.log_time_ns)
            if wait_s is None and self._may_step(record):
                return None
            if wait_s is not None and wait_s <= 0:
                return None
            self.changed.wait(LONGEST_WAIT_S if wait_s is None else min(wait_s, LONGEST_WAIT_S))
        return None

    def _may_step(self, record: Record) -> bool:
        """Tell whether a record is sent although the replay is paused.

        A step is a frame and what follows it until the next frame.
        """
        is_asked = self._steps != self._wish().steps
        if not self._is_frame(record):
            due = self._stepped or is_asked  # after a jump, what stands before the frame
        else:
            due = self._stepped = is_asked
            if due:
                self._steps += 1
        if due:
            self.time.jump(record.log_time_ns)
        return due

    def _follow(self) -> int | None:
        """Follow the wish; return where to jump, if that is new."""
        wish = self._wish()
        if not wish.paused:
            self._steps, self._stepped = wish.steps, False
        self.time.set(wish.speed, paused=wish.paused)
        if wish.position_s != self._position_s:
            self._position_s = wish.position_s
            length_ns = self._tape.end_ns - self._tape.begin_ns
            # To the millisecond, so that a jump to the same place again can be told.
            return self._tape.begin_ns + min(round(wish.position_s * 1e3) * 1_000_000, length_ns)
        return None

    def _wait_at_end(self) -> int | None:
        """Stay at the end while paused, where one can still jump back."""
        if self._wish().stay and not self._wish().loop:
            self._at_end()
        while not self._stopping() and self._wish().paused:
            jump_ns = self._follow()
            if jump_ns is not None:
                return jump_ns
            self.changed.wait(LONGEST_WAIT_S)
        return None
