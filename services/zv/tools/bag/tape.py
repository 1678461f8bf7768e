"""The part of a recording that is played."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from zenoh_vision import keys
from zenoh_vision.errors import ConfigurationError, ExpectationNotMet, PayloadError
from zenoh_vision.messages import ReplayMark, TrackEvent
from zenoh_vision.topics import EVENTS, REPLAY, topic_of
from zv.bag.record import Record
from zv.bag.recording import Recording, matcher

LATCHED = ("camera_info",)
"""Topics whose newest message holds until the next one, also after a jump."""


class RecordedTape:
    """Some keys of a recording, from a moment to another.

    By default those of all keys that do not begin with ``@``, to the end of the recording. Both
    moments are seconds since the first sample.

    Attributes:
        keys: The keys of the samples that are played.

    Raises:
        ConfigurationError: A text is no key expression, or the recording is shorter.
        ExpectationNotMet: The recording has nothing of that.
    """

    def __init__(
        self,
        recording: Recording,
        wanted: Sequence[str] = (),
        excluded: Sequence[str] = (),
        start_s: float = 0.0,
        end_s: float | None = None,
    ) -> None:
        self._recording = recording
        is_wanted = matcher(wanted or ("**",))
        is_excluded = matcher(excluded, without_any=False)
        recorded = recording.keys()
        self.keys = [
            key
            for key in recorded
            # What another replay said of itself is not said again.
            if is_wanted(key) and not is_excluded(key) and keys.suffix_of(key) != REPLAY.name
        ]
        if not self.keys:
            raise ExpectationNotMet(
                f"{recording.path} has no samples to play; its keys: {recording.keys_in_words()}"
            )
        self.begin_ns = recording.start_ns + round(start_s * 1e9)
        self.end_ns = recording.end_ns
        if self.begin_ns > self.end_ns:
            length_s = (recording.end_ns - recording.start_ns) / 1e9
            raise ConfigurationError(
                f"--start {start_s:g} s: the recording is {length_s:.1f} s long"
            )
        self._until_ns: int | None = None
        if end_s is not None:
            self._until_ns = recording.start_ns + round(end_s * 1e9)
            self.end_ns = min(self.end_ns, self._until_ns)

    @property
    def cameras(self) -> list[str]:
        """The cameras whose data are played."""
        found = {keys.camera_of(key) for key in self.keys if topic_of(key) is not None}
        return sorted(filter(keys.is_name, found))

    @property
    def namespaces(self) -> list[str]:
        """The namespaces of the cameras."""
        return sorted({key.split("/")[0] for key in self.keys if topic_of(key) is not None})

    def before(self, moment_ns: int) -> list[Record]:
        """Return the newest record of each latched key before a moment."""
        latched = [key for key in self.keys if keys.suffix_of(key) in LATCHED]
        if not latched or moment_ns <= self._recording.start_ns:
            return []
        newest = {
            record.key: record for record in self._recording.records(end_ns=moment_ns, keys=latched)
        }
        return list(newest.values())

    def marks(self, most: int) -> list[ReplayMark]:
        """Return the events of zones and lines, at most so many, at their times in the recording.

        Those that only say that a track began or ended are left out.
        """
        events = [key for key in self.keys if keys.suffix_of(key) == EVENTS.name]
        found: list[ReplayMark] = []
        for record in self._recording.records(keys=events) if events else ():
            try:
                event = TrackEvent.from_bytes(record.payload)
            except PayloadError:
                continue
            at_s = (record.log_time_ns - self.begin_ns) / 1e9
            if event.zone is not None and at_s >= 0 and len(found) < most:
                found.append(ReplayMark(at_s=at_s, event=event.event, zone=event.zone))
        return found

    def after(self, moment_ns: int) -> Iterator[Record]:
        """Yield the records from a moment on, in the order of their arrival."""
        return self._recording.records(start_ns=moment_ns, end_ns=self._until_ns, keys=self.keys)
