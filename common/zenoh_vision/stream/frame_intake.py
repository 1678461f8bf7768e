"""Turns samples into frames, with a state for each key."""

from __future__ import annotations

import threading
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

from zenoh_vision import keys
from zenoh_vision.errors import PayloadError
from zenoh_vision.image import forms
from zenoh_vision.image.depth import RangeFinder
from zenoh_vision.image.forms import PictureForm
from zenoh_vision.image.frame import Frame, Want, check_shows
from zenoh_vision.image.limits import MAX_PIXELS, MAX_SIDE
from zenoh_vision.keys import JPEG, RAW_IMAGE, RouteName
from zenoh_vision.messages import Header
from zenoh_vision.stream.buffer import Buffering, latest
from zenoh_vision.stream.epoch_gate import SILENCE_NS, EpochGate
from zenoh_vision.stream.intake import Consumer, InputState, Intake
from zenoh_vision.stream.sample import MAX_ATTACHMENT_BYTES, Sample, SizeLimit

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
    route: RouteName = "jpeg"
    newest: Header | None = None


@dataclass(frozen=True, slots=True)
class Arrival:
    """A frame with valid header, size and order; not decoded yet.

    Attributes:
        form: How its picture is written.
        stream: State of its key, which the intake may have forgotten meanwhile.
        header: Of the frame, with its time of arrival.
        size: What ``form.size`` returned of it.
        unverified: No picture of its epoch was decoded yet.
        number: Number of this frame among those that arrived on its key, from 1.
        missed: Number of the camera's frames that are missing up to this one.
    """

    sample: Sample
    form: PictureForm
    stream: KeyStream
    header: Header
    size: tuple[int, int] | None
    unverified: bool
    number: int
    missed: int


class FrameIntake(Intake[Arrival, Frame]):
    """Frames of one camera, or of several by wildcard: each key with a state of its own.

    Without wildcards all samples are of one stream, whatever their keys, forms and routes, so that
    a frame that comes twice counts once.

    Args:
        key, consumer, buffering: As for ``Intake``.
        encoding: Zenoh encoding of the pictures on the key, for samples that name none.
        max_pixels: Larger frames are dropped as ``too_large``, by their headers.

    Attributes:
        depth_limits: Lowest and highest of the 16-bit values that become 8 bits, each None for
            automatic; None for the whole range, as cv_bridge does.
    """

    def __init__(
        self,
        key: str,
        consumer: Consumer,
        buffering: Buffering = latest,
        *,
        encoding: str = JPEG,
        max_pixels: int = MAX_PIXELS,
    ) -> None:
        most = {each.encoding: each.most_bytes(max_pixels) for each in forms.FORMS.values()}
        limit = SizeLimit(most.get(encoding, most[JPEG]), by_encoding=most)
        super().__init__(key, consumer, buffering, limit)
        self._max_pixels = max_pixels
        self._encoding = encoding
        self.depth_limits: tuple[int | None, int | None] | None = None
        self._since_ns = self.clock.monotonic_ns()
        self._streams: dict[str, KeyStream] = {}  # the one that has been silent longest comes first
        self._lock = threading.Lock()

    def take(
        self,
        timeout_s: float,
        want: Want = "bgr",
        max_age_s: float | None = None,
        revision: Any = None,
    ) -> Frame | None:
        """Return the next frame, decoded; None after the time-out, or if it was dropped.

        The frame is pending until the consumer counts it as processed or dropped.

        Args:
            timeout_s: How long to wait.
            want: The view that is decoded here, so that its errors are counted here; or a
                function that decodes what its caller needs.
            max_age_s: Frames that are more than this later than the fastest of the last minute are
                dropped as ``stale``; None drops none.
            revision: Becomes ``Frame.revision``, before ``want`` is called.
        """
        arrival = self.buffer.take(timeout_s)
        return None if arrival is None else self.accept(arrival, max_age_s, want, revision)

    def accept(
        self,
        arrival: Arrival,
        max_age_s: float | None,
        want: Want | None = None,
        revision: Any = None,
    ) -> Frame | None:
        """Return the frame of an arrival; None if it was dropped as stale or no picture.

        For a consumer that takes the arrivals from ``buffer`` itself; called in their order.
        With ``want`` None only a frame of an unverified epoch is decoded, for a consumer that
        passes pictures on as they are; the arguments are otherwise those of ``take``.
        """
        header, sample, stream = arrival.header, arrival.sample, arrival.stream
        max_age_ns = None if max_age_s is None else int(max_age_s * 1e9)
        now_ns = self.clock.monotonic_ns()
        if max_age_ns is not None and stream.gate.is_stale(header, max_age_ns, now_ns):
            self._counters.drop("stale")
            if stream.late_since_ns is None:
                stream.late_since_ns = now_ns
            return None
        try:
            frame = forms.opened(arrival.form, sample.payload, header, arrival.size, sample.key)
            frame.revision = revision
            if frame.is_deep and want is not None and self.depth_limits is not None:
                stream.finder.limits = self.depth_limits
                frame.find_range(stream.finder)  # first, as it follows the stream
            if callable(want):
                want(frame)
            elif want is not None:
                frame.view(want)
            if arrival.unverified:  # a function may have decoded nothing of it
                frame.view("gray")
            stream.gate.accept(header, sample.arrived_ns, self.clock.monotonic_ns(), max_age_ns)
        except PayloadError as error:
            self._drop(error)
            return None
        stream.late_since_ns = None
        return frame

    def states(self) -> Sequence[InputState]:
        """Return the state of each key that sent frames; of the input as a whole if none did."""
        with self._lock:
            if not self._single:
                self._forget_silent(self.clock.monotonic_ns())
            found = [
                InputState(
                    stream.key,
                    stream.since_ns,
                    stream.late_since_ns,
                    stream.gate.offset_ns,
                    stream=name,
                    route=stream.route,
                )
                for name, stream in sorted(self._streams.items())
            ]
        return found or [InputState(self.key, self._since_ns, stream=self.key)]

    def _check(self, sample: Sample, key: str) -> tuple[Arrival, bool]:
        now_ns = sample.arrived_ns
        default = RAW_IMAGE if sample.route == "raw" else self._encoding
        form = forms.form_of(sample.encoding, sample.payload, default)
        with self._lock:
            stream = self._streams.get(key) or KeyStream(EpochGate(keys.camera_of(key)))
            header, size = checked_header(sample, form, stream.gate, self._max_pixels)
            if sample.route != stream.route and _came_already(stream, header, now_ns):
                raise PayloadError("duplicate", f"frame {header.seq} came by another route")
            unverified, missed = stream.gate.admit(header, now_ns)
            if not self._single or not self._streams:
                self._enter(key, stream, now_ns)
            stream.number += 1
            stream.missed += missed
            stream.since_ns = self._since_ns = now_ns
            stream.key, stream.route = sample.key, sample.route
            stream.newest = header
            arrival = Arrival(
                sample, form, stream, header, size, unverified, stream.number, stream.missed
            )
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


def _came_already(stream: KeyStream, header: Header, now_ns: int) -> bool:
    """Tell whether a frame, or a later one, already arrived by another route: that of the newest.

    Frames from shared memory also rule out earlier ones, since only processes of this user can
    write there. Frames from the network rule out only the very same frame; and none of the same
    route, since anyone can send a broken picture under the header of the next good one.
    """
    silent = now_ns - stream.since_ns >= SILENCE_NS
    newest = stream.newest
    if newest is None or header.run != newest.run or silent:
        return False
    return header.seq == newest.seq or (header.seq < newest.seq and stream.route == "shm")


def checked_header(
    sample: Sample, form: PictureForm, gate: EpochGate, max_pixels: int = MAX_PIXELS
) -> tuple[Header, tuple[int, int] | None]:
    """Check what a sample says of its picture: size, limits, encoding, number of bytes.

    Returns:
        Its header with the time of arrival, and the size that the payload states, if it does.

    Raises:
        PayloadError: It is no picture, or its header does not fit.
    """
    attachment, payload = sample.attachment, sample.payload
    if attachment is not None and len(attachment) > MAX_ATTACHMENT_BYTES:
        raise PayloadError("bad_header", f"an attachment of {len(attachment)} bytes")
    # First: what is no picture is named so, whatever its header.
    size = form.size(payload)
    encoding = form.pixel_encoding(payload) if attachment is None else ""
    header = gate.identify(attachment, size, sample.received_ns, sample.arrived_ns, encoding)
    width, height = header.width, header.height
    if width * height > max_pixels:
        raise PayloadError("too_large", f"{width}x{height} pixels, at most {max_pixels} in all")
    if max(width, height) > MAX_SIDE:
        raise PayloadError("too_large", f"{width}x{height} pixels, a side at most {MAX_SIDE}")
    form.check(payload, header)
    if size is not None and size != (width, height):
        check_shows(size, header)
    return header, size


def snapshot_of(sample: Sample, encoding: str = JPEG, max_pixels: int = MAX_PIXELS) -> Frame:
    """Return the frame of a single sample, such as the reply to a query; nothing is decoded yet.

    The camera of a bare picture on a key that names none is ``unknown``.

    ``encoding`` is that of the pictures on its key, if the sample names none. One with more than
    ``max_pixels`` is refused.

    Raises:
        PayloadError: It is no picture, or its header does not fit.
    """
    form = forms.form_of(sample.encoding, sample.payload, encoding)
    SizeLimit(form.most_bytes(max_pixels)).check(len(sample.payload))
    if sample.deleted:
        raise PayloadError("empty", "a deletion")
    camera = keys.camera_of(sample.key)
    gate = EpochGate(camera if keys.is_name(camera) else "unknown")
    header, size = checked_header(sample, form, gate, max_pixels)
    return forms.opened(form, sample.payload, header, size, sample.key)
