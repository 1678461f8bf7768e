"""Receive one key's frames: checked on arrival, newest wins, every loss counted by reason."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass

import zenoh

from common import images
from common.admission import Admission
from common.age import AgeGauge
from common.errors import PayloadError
from common.frame import Form, Frame
from common.ledger import Ledger
from common.link import Link
from common.messages import Header
from common.session import direct
from common.slot import Slot

MAX_ATTACHMENT_BYTES = 4096


@dataclass(frozen=True, slots=True)
class Arrival:
    """A frame whose header, size and order were found good; not decoded yet.

    Attributes:
        challenger: It is of an epoch that is not proven yet.
        number: How many came on this key up to it.
        missed: How many of the camera's frames up to it did not, by their sequence numbers.
    """

    header: Header
    payload: bytes
    raw: bool
    arrived_ns: int  # by the monotonic clock
    challenger: bool
    number: int
    missed: int


class FrameReceiver:
    """The subscriber's end of a stream of frames.

    Everything on Zenoh's thread is cheap (header, size, order); decoding is the taker's.

    Args:
        link: To the router.
        key: Key expression of the stream.
        camera: Whose frames it carries.
        raw: The payload is raw pixels instead of JPEG or PNG.
        max_age_s: Frames later than this over the best recently seen are dropped as stale;
            asked for each frame as it is taken.
        ledger: Counts what arrives and what becomes of it.
        complain: Called with each drop, for the log.
        arrived: Called on Zenoh's thread when there is one to take; must be quick.

    Attributes:
        begun_s: When it was made, monotonic.
        arrived_s: When the last good frame arrived, monotonic; None before the first.
    """

    def __init__(
        self,
        link: Link,
        key: str,
        *,
        camera: str,
        raw: bool,
        max_age_s: Callable[[], float],
        ledger: Ledger,
        complain: Callable[[PayloadError], None],
        arrived: Callable[[], None] = lambda: None,
    ) -> None:
        self.key = key
        self.begun_s = time.monotonic()
        self.age = AgeGauge(int(max_age_s() * 1e9))
        self.arrived_s: float | None = None
        self._max_age_s = max_age_s
        self.late_since_s: float | None = None  # monotonic; no frame was accepted since
        self._raw = raw
        self._ledger = ledger
        self._complain = complain
        self._admission = Admission(camera)
        self._arrived = arrived
        self._number = 0
        self._missed = 0
        self._slot = Slot[Arrival](lambda _: ledger.drop("overwritten"))
        self._subscriber = link.declare(
            lambda session: session.declare_subscriber(key, direct(self._on_sample))
        )

    @property
    def clock_offset_ns(self) -> int | None:
        """The least wall clock - stamp of the last minute; None before the first frame."""
        offset_ns = self.age.offset_ns
        if offset_ns is None:
            return None
        return offset_ns + time.time_ns() - time.monotonic_ns()

    def take(self, timeout_s: float, want: Form) -> Frame | None:
        """Return the newest frame, decoded in the form wanted; None if there is none in time.

        A frame handed out is pending until the caller reports it to the ledger.
        """
        arrival = self.arrival(timeout_s)
        return None if arrival is None else self.accept(arrival, want)

    def arrival(self, timeout_s: float) -> Arrival | None:
        """Return the newest that arrived; None if there is none in time.

        It is pending until ``accept``, which must be asked of each, one after the other.
        """
        return self._slot.take(timeout_s)

    def accept(self, arrival: Arrival, want: Form | None = None) -> Frame | None:
        """Return the frame of an arrival; None if it is stale or no picture, which is counted.

        Args:
            arrival: The newest.
            want: The form to decode. None for who passes it on as it is: it is decoded then
                only if it is a challenger, which must prove its epoch.
        """
        self.age.max_age_ns = int(self._max_age_s() * 1e9)
        header = arrival.header
        try:
            if self.age.is_stale(header.epoch, header.stamp_ns, time.monotonic_ns()):
                self._ledger.drop("stale")
                if self.late_since_s is None:
                    self.late_since_s = time.monotonic()
                return None
            frame = self._frame(arrival)
            if want is not None or arrival.challenger:
                frame.form(want or "gray")
            self._admission.accept(header, time.monotonic())
            self.age.accept(header.epoch, header.stamp_ns, arrival.arrived_ns)
            self.late_since_s = None
        except PayloadError as error:
            self._drop(error)
            return None
        return frame

    def close(self, unread: str | None = None) -> None:
        """Stop receiving.

        Args:
            unread: The reason under which frames that nobody took are dropped; None leaves
                them pending, for a node that ends with its receiver.
        """
        self._subscriber.undeclare()
        while unread and self._slot.take(0) is not None:
            self._ledger.drop(unread)

    def _frame(self, arrival: Arrival) -> Frame:
        header = arrival.header
        if not arrival.raw:
            return Frame(header, compressed=arrival.payload)
        pixels = images.from_raw(
            arrival.payload, header.encoding or "", header.width, header.height
        )
        return Frame(header, pixels=pixels)

    def _on_sample(self, sample: zenoh.Sample) -> None:
        self._ledger.arrive()
        try:
            arrival = self._admit(sample)
        except PayloadError as error:
            self._drop(error)
            return
        self._slot.put(arrival, challenger=arrival.challenger)
        self._arrived()

    def _admit(self, sample: zenoh.Sample) -> Arrival:
        now_ns, arrived_ns = time.time_ns(), time.monotonic_ns()
        at_s = arrived_ns / 1e9
        if sample.kind != zenoh.SampleKind.PUT:
            raise PayloadError("empty", "a delete instead of a picture")
        attachment = _attachment(sample)
        if self._raw:
            header = self._admission.identify(attachment, None, now_ns, at_s)
            payload = _raw_payload(sample, header)
        else:
            payload = _picture(sample)
            size = images.picture_size(payload)
            header = self._admission.identify(attachment, size, now_ns, at_s)
            images.encoding_named(header.encoding)
        challenger, missed = self._admission.admit(header, at_s)
        self._number += 1
        self._missed += missed
        if missed:
            self._ledger.note("missed", missed)
        if header.assumed:
            self._ledger.note("assumed_headers")
        self.age.arrive(header.epoch, header.stamp_ns, arrived_ns)
        self.arrived_s = at_s
        stamped = header.model_copy(update={"received_ns": now_ns})
        return Arrival(
            stamped, payload, self._raw, arrived_ns, challenger, self._number, self._missed
        )

    def _drop(self, error: PayloadError) -> None:
        self._ledger.drop(error.reason)
        self._complain(error)


def _attachment(sample: zenoh.Sample) -> bytes | None:
    if sample.attachment is None:
        return None
    if len(sample.attachment) > MAX_ATTACHMENT_BYTES:
        raise PayloadError("bad_header", f"an attachment of {len(sample.attachment)} bytes")
    return sample.attachment.to_bytes()


def _picture(sample: zenoh.Sample) -> bytes:
    """Copy the payload out, unless its length alone says that it is no picture of ours."""
    length, limit = len(sample.payload), images.MAX_COMPRESSED_BYTES
    if length > limit:
        raise PayloadError("too_large", f"{length} bytes, at most {limit} are allowed")
    return sample.payload.to_bytes()


def _raw_payload(sample: zenoh.Sample, header: Header) -> bytes:
    expected = images.raw_size(header.encoding, header.width, header.height)
    if len(sample.payload) != expected:
        raise PayloadError("wrong_size", f"{len(sample.payload)} bytes instead of {expected}")
    return sample.payload.to_bytes()
