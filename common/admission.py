"""Which arrivals may be seen: the rules on identity and order, with neither network nor clock.

A frame is seen at most once and never before an older one. A new epoch takes over only with a
picture that could be decoded, so that broken frames under a made-up identity cannot silence a
camera.
"""

from __future__ import annotations

import threading

from common.errors import PayloadError
from common.messages import Header

CLOCK_TOLERANCE_NS = 24 * 3600 * 10**9
"""How far ahead a stamp may be. Clocks are off by seconds or hours; a day ahead is no clock."""

SILENCE_S = 2.0
"""After so long without a frame of the current epoch, an older epoch may follow: a camera that
was started again while its clock was set back."""


class Admission:
    """The state of one key's stream.

    Args:
        camera: Whose frames this key carries.
    """

    def __init__(self, camera: str) -> None:
        self._camera = camera
        self._epoch: int | None = None
        self._identified = False
        self._seq = -1
        self._accepted_s = float("-inf")
        self._arrived_seq = -1
        self._challenger: int | None = None
        self._challenger_seq = -1
        self._bare_epoch: int | None = None
        self._bare_seq = 0
        self._lock = threading.Lock()

    def identify(
        self, attachment: bytes | None, size: tuple[int, int] | None, now_ns: int, at_s: float
    ) -> Header:
        """Return the header that came with a picture, or one made up on its arrival.

        Args:
            attachment: The sample's, or None from a publisher that sends bare pictures.
            size: Width and height by the picture's own header; None for raw pixels, which
                have none.
            now_ns: Wall clock, ns since 1970.
            at_s: Monotonic clock, seconds.

        Raises:
            PayloadError: ``bad_header wrong_camera bad_stamp wrong_size``, or ``no_header`` for
                a bare picture while a publisher that identifies its frames is active.
        """
        if attachment is None:
            if size is None:
                raise PayloadError("no_header", "raw pixels say nothing without a header")
            return self._made_up(size, now_ns, at_s)
        header = Header.from_bytes(attachment)
        if header.camera != self._camera:
            raise PayloadError(
                "wrong_camera", f"header of {header.camera} on a key of {self._camera}"
            )
        for name, value in (("stamp_ns", header.stamp_ns), ("epoch", header.epoch)):
            if not 0 <= value <= now_ns + CLOCK_TOLERANCE_NS:
                raise PayloadError("bad_stamp", f"{name} {value} is no time that a clock has now")
        if size is not None and size != (header.width, header.height):
            raise PayloadError(
                "wrong_size",
                f"picture {size[0]}x{size[1]}, header {header.width}x{header.height}",
            )
        return header

    def admit(self, header: Header, at_s: float) -> tuple[bool, int]:
        """Decide on an arrival's place.

        Returns:
            Whether it is a challenger (of an epoch not proven yet), and how many frames of the
            current epoch never arrived before it.

        Raises:
            PayloadError: ``out_of_order``: seen already, older than one seen, or of an older
                epoch while the current one is alive. ``no_header``: a bare picture while an
                identified stream is alive.
        """
        with self._lock:
            self._check_order(header, at_s)
            if header.epoch != self._epoch:
                if header.epoch != self._challenger:
                    self._challenger, self._challenger_seq = header.epoch, -1
                self._challenger_seq = max(self._challenger_seq, header.seq)
                return True, 0
            missed = max(0, header.seq - self._arrived_seq - 1)
            self._arrived_seq = max(self._arrived_seq, header.seq)
            return False, missed

    def accept(self, header: Header, at_s: float) -> None:
        """Take note that a frame was decoded and is about to be seen.

        Raises:
            PayloadError: As for ``admit``, if another was accepted since it was admitted.
        """
        with self._lock:
            self._check_order(header, at_s)
            if header.epoch != self._epoch:
                # Others of this epoch may have arrived while this one was decoded.
                others = self._challenger_seq if header.epoch == self._challenger else -1
                self._arrived_seq = max(others, header.seq)
            if header.epoch != self._bare_epoch:
                self._bare_epoch = None  # bare pictures that follow are another run
            self._identified = not header.assumed
            self._epoch, self._seq, self._accepted_s = header.epoch, header.seq, at_s

    def _check_order(self, header: Header, at_s: float) -> None:
        if header.epoch == self._epoch:
            if header.seq <= self._seq:
                raise PayloadError("out_of_order", f"frame {header.seq} after {self._seq}")
        elif header.assumed:
            self._check_alone(at_s)
        elif self._identified and header.epoch < (self._epoch or 0) and self._alive(at_s):
            raise PayloadError("out_of_order", f"epoch {header.epoch} after {self._epoch}")

    def _check_alone(self, at_s: float) -> None:
        """Refuse a bare picture beside a stream that identifies its frames."""
        if self._identified and self._alive(at_s):
            raise PayloadError("no_header", "a bare picture beside an identified stream")

    def _alive(self, at_s: float) -> bool:
        return at_s - self._accepted_s < SILENCE_S

    def _made_up(self, size: tuple[int, int], now_ns: int, at_s: float) -> Header:
        with self._lock:
            self._check_alone(at_s)
            if self._bare_epoch is None:
                self._bare_epoch, self._bare_seq = now_ns, 0
            seq, self._bare_seq = self._bare_seq, self._bare_seq + 1
            return Header(
                camera=self._camera,
                epoch=self._bare_epoch,
                seq=seq,
                stamp_ns=now_ns,
                width=size[0],
                height=size[1],
                encoding="bgr8",
                assumed=True,
            )
