"""Turns samples into frames, with a state for each key."""

from __future__ import annotations

import threading
import time
from collections.abc import Sequence
from dataclasses import dataclass, field

from zenoh_vision import keys
from zenoh_vision.errors import PayloadError
from zenoh_vision.image import codecs, pixel_formats
from zenoh_vision.image.bits import bits_size, unpack_bits
from zenoh_vision.image.depth import RangeFinder
from zenoh_vision.image.frame import Frame, Want
from zenoh_vision.image.pixel_formats import MAX_PIXEL_BYTES, MAX_PIXELS, MAX_SIDE
from zenoh_vision.keys import Way
from zenoh_vision.messages import Header
from zenoh_vision.stream.buffer import Buffering, latest
from zenoh_vision.stream.epoch_gate import SILENCE_NS, EpochGate
from zenoh_vision.stream.intake import Consumer, InputState, Intake
from zenoh_vision.stream.sample import MAX_ATTACHMENT_BYTES, PICTURE_LIMIT, Sample, SizeLimit

MAX_KEYS = 1000
"""Keys that an intake with wildcards follows; anyone can publish on any number of them. When it is
full, a new key replaces the one that has been silent longest, if that is at least ``SILENCE_NS``.
"""

FORGET_NS = 60 * 10**9
"""An intake with wildcards forgets a key that was silent for this time: its camera is gone."""


@dataclass(slots=True)
class KeyStream:
    """State of a stream that has sent frames. Times are monotonic, ns.

    ``key`` is that of the newest frame.
    """

    gate: EpochGate
    key: str = ""
    since_ns: int = 0  # last good arrival
    number: int = 0
    missed: int = 0
    late_since_ns: int | None = None
    finder: RangeFinder = field(default_factory=RangeFinder)
    way: Way = "jpeg"
    seq: int = -1  # of the newest arrival, and its epoch
    epoch: int = 0


@dataclass(frozen=True, slots=True)
class Arrival:
    """A frame with valid header, size and order; not decoded yet.

    Attributes:
        stream: State of its key, which the intake may have forgotten meanwhile.
        header: Of the frame, with its time of arrival.
        unverified: No picture of its epoch was decoded yet.
        number: Number of this frame among those that arrived on its key, from 1.
        missed: Number of the camera's frames that are missing up to this one.
    """

    sample: Sample
    stream: KeyStream
    header: Header
    unverified: bool
    number: int
    missed: int


class FrameIntake(Intake[Arrival, Frame]):
    """Frames of one camera, or of several by wildcard: each key with a state of its own.

    Args:
        key, consumer, buffering: As for ``Intake``.
        raw: The payloads are raw pixels instead of JPEG or PNG.
        raw_key: Another key that carries the same frames as raw pixels: both are one stream, so
            that each frame counts once.
        borrow: Frames of raw pixels may be views of the transport's memory; else they own their
            memory.
        max_pixels: Larger frames are dropped as ``too_large``, by their headers.

    Attributes:
        awaited: The keys on one of which the first frame may arrive.
        way: How the newest frame arrived; None before the first.
        depth_limits: Lowest and highest of the 16-bit values that become 8 bits, each None for
            automatic; None for the whole range, as cv_bridge does.
    """

    def __init__(
        self,
        key: str,
        consumer: Consumer,
        buffering: Buffering = latest,
        *,
        raw: bool = False,
        raw_key: str | None = None,
        borrow: bool = False,
        max_pixels: int = MAX_PIXELS,
    ) -> None:
        super().__init__(key, consumer, buffering, picture_limit(max_pixels, raw=raw))
        self._max_pixels = max_pixels
        self._raw = raw
        self._raw_key = raw_key
        self.awaited: tuple[str, ...] = (key,)
        self.way: Way | None = None
        self._newest_key: str | None = None
        self.depth_limits: tuple[int | None, int | None] | None = None
        self._borrow = borrow
        self._since_ns = time.monotonic_ns()
        self._streams: dict[str, KeyStream] = {}  # the one that has been silent longest comes first
        self._lock = threading.Lock()

    def take(self, timeout_s: float, want: Want, max_age_s: float | None) -> Frame | None:
        """Return the next frame, decoded; None after the time-out, or if it was dropped.

        The frame is pending until the consumer counts it as processed or dropped.

        Args:
            timeout_s: How long to wait.
            want: The form that is decoded here, so that its errors are counted here; or a
                function that decodes what its caller needs.
            max_age_s: Frames that are more than this later than the fastest of the last minute are
                dropped as ``stale``; None drops none.
        """
        arrival = self.arrival(timeout_s)
        return None if arrival is None else self.accept(arrival, max_age_s, want)

    def arrival(self, timeout_s: float) -> Arrival | None:
        """Return the next arrival, not decoded; None after the time-out.

        ``accept`` must be called with each arrival, in their order.
        """
        item = self._next(timeout_s)
        return None if item is None else item[1]

    def accept(
        self, arrival: Arrival, max_age_s: float | None, want: Want | None = None
    ) -> Frame | None:
        """Return the frame of an arrival; None if it was dropped as stale or no picture.

        With ``want`` None only a frame of an unverified epoch is decoded, for a consumer that
        passes pictures on as they are; the arguments are otherwise those of ``take``.
        """
        header, sample, stream = arrival.header, arrival.sample, arrival.stream
        max_age_ns = None if max_age_s is None else int(max_age_s * 1e9)
        now_ns = time.monotonic_ns()
        if max_age_ns is not None and stream.gate.is_stale(header, max_age_ns, now_ns):
            self._counters.drop("stale")
            if stream.late_since_ns is None:
                stream.late_since_ns = now_ns
            return None
        try:
            frame = frame_of(
                sample,
                header,
                raw=self._is_raw(sample.key),
                borrow=self._borrow,
                finder=self._finder(stream),
            )
            if callable(want):
                want(frame)
            elif want is not None or arrival.unverified:
                frame.form(want or "gray")
            stream.gate.accept(header, sample.arrived_ns, time.monotonic_ns(), max_age_ns)
        except PayloadError as error:
            self._drop(error)
            return None
        stream.late_since_ns = None
        return frame

    def states(self) -> Sequence[InputState]:
        """Return the state of each key that sent frames; of the input as a whole if none did."""
        with self._lock:
            if "*" in self.key:
                self._forget_silent(time.monotonic_ns())
            found = [
                InputState(
                    stream.key,
                    stream.since_ns,
                    stream.late_since_ns,
                    stream.gate.offset_ns,
                    stream=name,
                    way=stream.way,
                )
                for name, stream in sorted(self._streams.items())
            ]
            awaited = " or ".join(self.awaited)
            return found or [InputState(awaited, self._since_ns, stream=self.key)]

    @property
    def newest(self) -> tuple[str | None, int]:
        """Key and monotonic time of the last good arrival; at first None and the intake's start."""
        with self._lock:
            return self._newest_key, self._since_ns

    def limit_of(self, key: str) -> SizeLimit:
        """Return the limit of the size of a payload on a key."""
        return picture_limit(self._max_pixels, raw=self._is_raw(key))

    def _finder(self, stream: KeyStream) -> RangeFinder | None:
        if self.depth_limits is None:
            return None
        stream.finder.limits = self.depth_limits
        return stream.finder

    def _is_raw(self, key: str) -> bool:
        return self._raw or key == self._raw_key

    def _stream_key(self, key: str) -> str:
        return self.key if key == self._raw_key else key

    def _check(self, sample: Sample) -> tuple[Arrival, bool]:
        key, now_ns = self._stream_key(sample.key), sample.arrived_ns
        raw = self._is_raw(sample.key)
        with self._lock:
            stream = self._streams.get(key) or KeyStream(EpochGate(keys.camera_of(key)))
            header = checked_header(sample, stream.gate, self._max_pixels, raw=raw)
            way: Way = "shm" if sample.shared else "raw" if raw else "jpeg"
            if _came_already(stream, way, header, now_ns):
                raise PayloadError("duplicate", f"frame {header.seq} came another way")
            unverified, missed = stream.gate.admit(header, now_ns)
            self._enter(key, stream, now_ns)
            stream.number += 1
            stream.missed += missed
            stream.since_ns = self._since_ns = now_ns
            stream.key = self._newest_key = sample.key
            stream.way = self.way = way
            stream.epoch, stream.seq = header.epoch, header.seq
            arrival = Arrival(sample, stream, header, unverified, stream.number, stream.missed)
        if missed:
            self._counters.note("missed", missed)
        if header.assumed:
            self._counters.note("assumed_headers")
        return arrival, unverified

    def _enter(self, key: str, stream: KeyStream, now_ns: int) -> None:
        """Record a frame of a key as the newest; make room for the key if it is new."""
        known = self._streams.pop(key, None)
        if known is None and len(self._streams) >= MAX_KEYS:
            silent_longest = next(iter(self._streams))
            if now_ns - self._streams[silent_longest].since_ns < SILENCE_NS:
                raise PayloadError("too_many_keys", f"more than {MAX_KEYS} match {self.key}")
            del self._streams[silent_longest]
        self._streams[key] = stream

    def _forget_silent(self, now_ns: int) -> None:
        for key, stream in list(self._streams.items()):
            if now_ns - stream.since_ns < FORGET_NS:
                return
            del self._streams[key]


def _came_already(stream: KeyStream, way: Way, header: Header, now_ns: int) -> bool:
    """Tell whether a frame, or a later one, already arrived by another transport.

    Frames from shared memory also rule out earlier ones, since only processes of this user can
    write there. Frames from the network rule out only the very same frame.
    """
    if way == stream.way or header.epoch != stream.epoch or now_ns - stream.since_ns >= SILENCE_NS:
        return False
    return header.seq == stream.seq or (header.seq < stream.seq and stream.way == "shm")


def picture_limit(max_pixels: int, *, raw: bool) -> SizeLimit:
    """Return the most bytes of a picture with up to ``max_pixels`` pixels."""
    return SizeLimit(max_pixels * MAX_PIXEL_BYTES) if raw else PICTURE_LIMIT


def checked_header(
    sample: Sample, gate: EpochGate, max_pixels: int = MAX_PIXELS, *, raw: bool
) -> Header:
    """Check the sizes of a sample and return its header with the time of arrival.

    Raises:
        PayloadError: It is no picture, or its header does not fit.
    """
    if sample.attachment is not None and len(sample.attachment) > MAX_ATTACHMENT_BYTES:
        raise PayloadError("bad_header", f"an attachment of {len(sample.attachment)} bytes")
    payload = sample.payload
    bits = sample.encoding == keys.BITS
    size = None if raw or bits else codecs.picture_size(bytes(payload))
    bare = sample.attachment is None
    encoding = codecs.stored_encoding(bytes(payload[: codecs.PNG_HEAD])) if bare else ""
    header = gate.identify(sample.attachment, size, sample.received_ns, sample.arrived_ns, encoding)
    if header.width * header.height > max_pixels:
        raise PayloadError(
            "too_large", f"{header.width}x{header.height} pixels, at most {max_pixels} in all"
        )
    if max(header.width, header.height) > MAX_SIDE:
        raise PayloadError(
            "too_large", f"{header.width}x{header.height} pixels, a side at most {MAX_SIDE}"
        )
    if raw or bits:
        expected = (
            bits_size(header.width, header.height)
            if bits
            else pixel_formats.raw_size(header.encoding, header.width, header.height)
        )
        if len(payload) != expected:
            raise PayloadError("wrong_size", f"{len(payload)} bytes instead of {expected}")
    else:
        pixel_formats.encoding_named(header.encoding)
    return header


def frame_of(
    sample: Sample,
    header: Header,
    *,
    raw: bool,
    borrow: bool = False,
    finder: RangeFinder | None = None,
) -> Frame:
    """Return the frame of a sample whose header was checked; nothing is decoded yet."""
    if sample.encoding == keys.BITS:
        mono = header.model_copy(update={"encoding": "mono8"})
        pixels = unpack_bits(sample.payload, header.width, header.height)
        return Frame(mono, pixels=pixels, key=sample.key, bilevel=True)
    if not raw:
        return Frame(header, compressed=bytes(sample.payload), key=sample.key, finder=finder)
    payload = sample.payload if borrow or sample.shared else bytes(sample.payload)
    rows = pixel_formats.from_raw(payload, header.encoding or "", header.width, header.height)
    borrowed = isinstance(payload, memoryview) and not sample.shared
    return Frame(header, pixels=rows, key=sample.key, borrowed=borrowed, finder=finder)


def snapshot_of(
    sample: Sample,
    max_pixels: int = MAX_PIXELS,
    *,
    raw: bool,
    finder: RangeFinder | None = None,
) -> Frame:
    """Return the frame of a single sample, such as the reply to a query.

    The camera of a bare picture on a key that names none is ``unknown``.

    Raises:
        PayloadError: It is no picture, or its header does not fit.
    """
    if sample.deleted:
        raise PayloadError("empty", "a deletion")
    camera = keys.camera_of(sample.key)
    gate = EpochGate(camera if keys.is_name(camera) else "unknown")
    header = checked_header(sample, gate, max_pixels, raw=raw)
    return frame_of(sample, header, raw=raw, finder=finder)
