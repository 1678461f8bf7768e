"""Decides which frames of one key a consumer may see, by identity, order, epoch and age.

The package's docstring has the rules and their reasons. Uses neither the network nor a clock.
"""

from __future__ import annotations

import threading
from collections import deque
from dataclasses import dataclass

from zenoh_vision.errors import PayloadError
from zenoh_vision.keys import is_name
from zenoh_vision.messages import Header

CLOCK_TOLERANCE_NS = 24 * 3600 * 10**9
"""How far ahead a stamp may be: clocks are wrong by seconds or hours, not by a day."""

SILENCE_NS = 1_500_000_000
"""After this time without an accepted frame, frames may follow that were refused before: those of
an older epoch, or of the current epoch with a lower ``seq``."""

SETTLE_NS = 1_500_000_000
"""Frames that stay equally late for this time have stamps of another clock."""

STEADY_NS = 400_000_000
"""Most variation of lateness in a stream of frames that did not wait in a queue."""

STEP = 1000
STEP_PER_S = 1000
"""How far ``seq`` may advance from one accepted frame to the next: faster than any camera."""

NO_RUN = (0, 0)


@dataclass(slots=True)
class Run:
    """Arrivals, in order and equally late, of frames that are not accepted, or not yet."""

    epoch: tuple[int, int]  # with the pass of a replay: ``Header.run``
    begun_ns: int
    seq: int
    least_offset_ns: int
    greatest_offset_ns: int

    def settled(self, now_ns: int) -> bool:
        """Tell whether the run is long enough to be a live stream with another clock."""
        return now_ns - self.begun_ns > SETTLE_NS

    @classmethod
    def begin(cls, header: Header, now_ns: int) -> Run:
        """Return a run that begins with an arrival."""
        offset = now_ns - header.age_start_ns
        return cls(header.run, now_ns, header.seq, offset, offset)

    def extend(self, header: Header, now_ns: int) -> bool:
        """Add an arrival; return False if it does not continue the run.

        Frames from a queue that drains are less and less late; frames of a live stream with another
        clock stay late by the same amount.
        """
        offset = now_ns - header.age_start_ns
        least = min(self.least_offset_ns, offset)
        greatest = max(self.greatest_offset_ns, offset)
        if header.run != self.epoch or header.seq <= self.seq or greatest - least > STEADY_NS:
            return False
        self.seq, self.least_offset_ns, self.greatest_offset_ns = header.seq, least, greatest
        return True


class EpochGate:
    """The state of one key's stream; safe between threads.

    All times but ``received_ns`` are monotonic, in nanoseconds.

    Args:
        camera: The camera whose frames the key carries.
    """

    def __init__(self, camera: str) -> None:
        self._camera = camera
        self._epoch: tuple[int, int] | None = None
        self._identified = False
        self._seq = -1
        self._last_stamp_ns = 0
        self._accepted_ns: int | None = None
        self._arrived_ns = 0
        self._arrived_seq = -1
        self._unverified: Run | None = None
        self._refused: Run | None = None
        self._bare_epoch: int | None = None
        self._bare_seq = 0
        self._gauge = StalenessGauge()
        self._lock = threading.Lock()

    @property
    def offset_ns(self) -> int | None:
        """The least ``now - stamp`` of the last minute, ns; None before the first frame."""
        with self._lock:
            return self._gauge.offset_ns

    def identify(
        self,
        attachment: bytes | None,
        size: tuple[int, int] | None,
        received_ns: int,
        now_ns: int,
        encoding: str = "bgr8",
    ) -> Header:
        """Return the header that came with a picture, or one created on its arrival.

        The header carries the time of arrival.

        Args:
            attachment: The header's bytes; None from a publisher that sends bare pictures.
            size: Width and height that a bare picture states; None if its payload states none.
            received_ns: Wall-clock time of arrival, since 1970.
            now_ns: Monotonic time of arrival.
            encoding: Of a bare picture.

        Raises:
            PayloadError: ``bad_header wrong_camera bad_stamp``, or ``no_header`` for a bare
                picture that states no size, or while a publisher that identifies its frames is
                active.
        """
        if attachment is None:
            if size is None:
                raise PayloadError("no_header", "pictures of this form need a header")
            if not is_name(self._camera):
                raise PayloadError("no_header", "a bare picture on a key that names no camera")
            return self._made_up(size, received_ns, now_ns, encoding)
        header = Header.arrived(attachment, received_ns)
        if header.camera != self._camera:
            raise PayloadError(
                "wrong_camera", f"header of {header.camera} on a key of {self._camera}"
            )
        for name in ("stamp_ns", "epoch", "replay", "replayed_ns"):
            value = getattr(header, name)
            if value is not None and not 0 <= value <= received_ns + CLOCK_TOLERANCE_NS:
                raise PayloadError("bad_stamp", f"{name} {value} is negative or over 24 h ahead")
        return header

    def admit(self, header: Header, now_ns: int) -> tuple[bool, int]:
        """Record an arrival, or refuse it.

        Returns:
            Whether its epoch is unverified, and how many frames of the current epoch are missing
            before it.

        Raises:
            PayloadError: ``out_of_order``: its ``seq`` is not above that of the last accepted
                frame of its epoch, or higher than a camera can have counted since, or its epoch
                is older than the current one, of which frames still arrive. ``no_header``: a
                bare picture, while frames with headers arrive.
        """
        with self._lock:
            try:
                follows = self._check_order(header, header.run, now_ns, now_ns)
            except PayloadError:
                self._refused = _continued(self._refused, header, now_ns)
                raise
            if not follows:
                self._unverified = _continued(self._unverified, header, now_ns)
                return True, 0
            missed = max(0, header.seq - self._arrived_seq - 1)
            self._arrived_seq = max(self._arrived_seq, header.seq)
            return False, missed

    def is_stale(self, header: Header, max_age_ns: int, now_ns: int) -> bool:
        """Tell whether a frame is later than the best of the last minute by over ``max_age_ns``.

        One whose sender waits for the answer never is.
        """
        if header.lockstep:
            return False
        with self._lock:
            if self._gauge.lateness_ns(header.age_start_ns, now_ns) <= max_age_ns:
                return False
            return not self._is_another_clock(header, now_ns)

    def accept(
        self, header: Header, arrived_ns: int, now_ns: int, max_age_ns: int | None = None
    ) -> None:
        """Record that a frame was decoded and will be handed out.

        Only accepted frames count for the least lateness of the last minute: broken frames with
        false headers must not make the good ones look late.

        ``max_age_ns`` is as for ``is_stale``; None if no frame is too old.

        Raises:
            PayloadError: ``overwritten``: a later frame of its epoch was accepted first, since
                verified frames are taken before unverified ones. Otherwise as for ``admit``, if
                another was accepted since it was admitted.
        """
        with self._lock:
            run, stamp_ns = header.run, header.age_start_ns
            if run == self._epoch and header.seq < self._seq and self._alive(now_ns):
                raise PayloadError("overwritten", f"frame {header.seq} after {self._seq}")
            if not self._check_order(header, run, arrived_ns, now_ns):
                # Others of this run may have arrived while this one was decoded.
                unverified = _run_of(header, self._unverified)
                self._arrived_seq = header.seq if unverified is None else unverified.seq
                if run <= (self._epoch or NO_RUN):
                    self._gauge.restart()  # bare frames before it had another identity and clock
                self._unverified = None
            elif stamp_ns < self._last_stamp_ns:
                self._gauge.restart()  # a clock that was set back: the old offsets do not apply
            self._refused = None
            if header.epoch != self._bare_epoch:
                self._bare_epoch = None  # bare pictures that follow are a new epoch
            self._identified = not header.assumed
            # The time of its arrival, not of this call: otherwise a false frame would block the
            # true ones for longer, the longer it takes to decode.
            self._epoch, self._seq, self._accepted_ns = run, header.seq, arrived_ns
            self._arrived_ns = arrived_ns
            self._last_stamp_ns = stamp_ns
            self._gauge.note(stamp_ns, arrived_ns, max_age_ns)

    def _check_order(
        self, header: Header, run: tuple[int, int], arrived_ns: int, now_ns: int
    ) -> bool:
        """Return whether a frame follows in the current epoch, by a possible step of ``seq``.

        Raises:
            PayloadError: It may not be accepted.
        """
        if run == self._epoch:
            since_ns = max(0, arrived_ns - self._arrived_ns)
            if 0 < header.seq - self._seq <= STEP + STEP_PER_S * since_ns // 10**9:
                return True
            if not self._replaces(header, now_ns):
                raise PayloadError("out_of_order", f"frame {header.seq} after {self._seq}")
        elif header.assumed:
            self._check_no_identified_stream(now_ns)
        elif self._identified and run < (self._epoch or NO_RUN) and self._alive(now_ns):
            raise PayloadError("out_of_order", f"epoch {header.epoch} after {self._epoch}")
        return False

    def _replaces(self, header: Header, now_ns: int) -> bool:
        """Tell whether a frame is of a live stream that a frame with a wrong ``seq`` blocked."""
        if self._alive(now_ns):
            return False
        refused = _run_of(header, self._refused)
        return refused is not None and header.seq > refused.seq and refused.settled(now_ns)

    def _check_no_identified_stream(self, now_ns: int) -> None:
        if self._identified and self._alive(now_ns):
            raise PayloadError("no_header", "a bare picture beside an identified stream")

    def _alive(self, now_ns: int) -> bool:
        return self._accepted_ns is not None and now_ns - self._accepted_ns < SILENCE_NS

    def _is_another_clock(self, header: Header, now_ns: int) -> bool:
        """Tell whether a frame that looks late has a stamp of another clock instead."""
        if header.run == self._epoch and header.age_start_ns < self._last_stamp_ns:
            return True  # frames of an epoch come in order: only a clock set back stamps earlier
        runs = (_run_of(header, self._unverified), _run_of(header, self._refused))
        return any(run is not None and run.settled(now_ns) for run in runs)

    def _made_up(
        self, size: tuple[int, int], received_ns: int, now_ns: int, encoding: str
    ) -> Header:
        with self._lock:
            self._check_no_identified_stream(now_ns)
            if self._bare_epoch is None:
                self._bare_epoch, self._bare_seq = received_ns, 0
            seq, self._bare_seq = self._bare_seq, self._bare_seq + 1
            return Header(
                camera=self._camera,
                epoch=self._bare_epoch,
                seq=seq,
                stamp_ns=received_ns,
                width=size[0],
                height=size[1],
                encoding=encoding,
                received_ns=received_ns,
                assumed=True,
            )


def _run_of(header: Header, run: Run | None) -> Run | None:
    """Return the run if the frame is of its epoch."""
    return run if run and run.epoch == header.run else None


def _continued(run: Run | None, header: Header, now_ns: int) -> Run:
    """Return the run with an arrival added, or a new run if the arrival does not continue it."""
    return run if run and run.extend(header, now_ns) else Run.begin(header, now_ns)


WINDOW_NS = 60 * 10**9
STEP_NS = 10**9
"""A frame within this time after a faster one is left out, so that few are kept."""


class StalenessGauge:
    """Measures how late a frame is without a common clock; not locked.

    The clocks of two machines differ, so ``now - stamp`` is no age. But the difference to its own
    minimum of the last minute is how much longer a frame was delayed than the fastest one.
    ``now`` is monotonic.
    """

    def __init__(self) -> None:
        # Time and offset, ns: the least first, and each the least of those that came after it.
        self._minima: deque[tuple[int, int]] = deque()

    @property
    def offset_ns(self) -> int | None:
        """The least delay plus the difference of the clocks, ns; None if unknown."""
        return self._minima[0][1] if self._minima else None

    def lateness_ns(self, stamp_ns: int, now_ns: int) -> int:
        """Return how much later a frame is than the best of the last minute; 0 for the first."""
        while self._minima and now_ns - self._minima[0][0] > WINDOW_NS:
            self._minima.popleft()
        return now_ns - stamp_ns - self._minima[0][1] if self._minima else 0

    def note(self, stamp_ns: int, now_ns: int, max_age_ns: int | None = None) -> None:
        """Add a frame; if it is later than ``max_age_ns``, those before had another clock."""
        offset = now_ns - stamp_ns
        while self._minima and now_ns - self._minima[0][0] > WINDOW_NS:
            self._minima.popleft()
        if max_age_ns is not None and self._minima and offset - self._minima[0][1] > max_age_ns:
            self._minima.clear()
        while self._minima and self._minima[-1][1] > offset:
            self._minima.pop()
        if not self._minima or now_ns - self._minima[-1][0] >= STEP_NS:
            self._minima.append((now_ns, offset))

    def restart(self) -> None:
        """Forget all frames: those that follow have stamps of another clock."""
        self._minima.clear()
