"""Frames of a recording, and the results of the same frames."""

from __future__ import annotations

from contextlib import suppress

from zenoh_vision.errors import ExpectationNotMet, PayloadError
from zenoh_vision.image.forms import form_of, opened
from zenoh_vision.image.frame import Frame
from zenoh_vision.messages import Centroid, Header, Tracks
from zv.bag.record import Record
from zv.bag.recording import Recording

AHEAD_NS = 2 * 10**9
"""A result is looked for among what arrived this long after its frame."""

Result = Tracks | Centroid


def the_key(recording: Recording, wanted: str | None, kinds: tuple[str, ...], what: str) -> str:
    """Return the key that is wanted, or else the only one whose encoding begins so.

    Raises:
        ExpectationNotMet: There is none, or there are several.
    """
    keys = set(recording.keys())
    if wanted is not None:
        key = wanted.removeprefix("/")
        if key not in keys:
            raise ExpectationNotMet(
                f"{recording.path} has no {key}; its keys: {recording.keys_in_words()}"
            )
        return key
    found = sorted(
        {
            each.topic
            for each in recording.channels()
            if each.metadata.get("zenoh_encoding", "").startswith(kinds) and each.topic in keys
        }
    )
    cameras = [each for each in found if each.endswith(("/image/compressed", "/tracks"))]
    if not found:
        raise ExpectationNotMet(f"{recording.path} has no {what}")
    if len(cameras or found) != 1:
        names = ", ".join(cameras or found)
        raise ExpectationNotMet(f"{recording.path} has not one key of {what}: {names}; give --key")
    return (cameras or found)[0]


def frame_of(record: Record) -> Frame | None:
    """Return the frame in a record; None if it is none that can be read."""
    try:
        header = Header.from_bytes(record.attachment or b"")
        form = form_of(record.encoding, record.payload)
        return opened(form, record.payload, header, key=record.key)
    except PayloadError:
        return None


class Results:
    """Finds the result of a frame among the messages of its camera, in bounded memory."""

    def __init__(self, recording: Recording, key: str, kind: type[Result]) -> None:
        self._records = recording.records(keys=[key])
        self._kind = kind
        self._next: Record | None = next(self._records, None)
        self._known: dict[tuple[int, int], tuple[int, Result]] = {}

    def of(self, record: Record) -> Result | None:
        """Return the result of the frame in a record; frames are asked for in their order."""
        until_ns = record.log_time_ns + AHEAD_NS
        while self._next is not None and self._next.log_time_ns <= until_ns:
            epoch, seq = self._next.number("epoch"), self._next.number("seq")
            if epoch is not None and seq is not None:
                with suppress(PayloadError):
                    found = self._kind.from_bytes(self._next.payload)
                    self._known[epoch, seq] = self._next.log_time_ns, found
            self._next = next(self._records, None)
        self._known = {
            name: known
            for name, known in self._known.items()
            if known[0] >= record.log_time_ns - AHEAD_NS
        }
        epoch, seq = record.number("epoch"), record.number("seq")
        return self._known.get((epoch or 0, seq or 0), (0, None))[1]


def results_of(recording: Recording, picture_key: str) -> Results | None:
    """Return the tracks, or else the centroids, of the camera of a picture's key."""
    keys, camera = recording.keys(), "/".join(picture_key.split("/")[:2])
    kinds: tuple[tuple[str, type[Result]], ...] = (("tracks", Tracks), ("centroid", Centroid))
    for name, kind in kinds:
        if f"{camera}/{name}" in keys:
            return Results(recording, f"{camera}/{name}", kind)
    return None
