"""Turns a record into the sample that a replay sends: its key, its header, the mark of a replay."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, Final

import msgpack

from zenoh_vision import keys
from zenoh_vision.errors import PayloadError
from zenoh_vision.message_codec import unpack
from zv.bag.layout import MAX_TIME_NS
from zv.bag.record import Record

TIMES: Final = ("stamp_ns", "received_ns", "done_ns")
MOST_SHIFTS: Final = 1000
"""Frames whose new stamps are kept, since the results of a frame come after it."""


@dataclass(frozen=True, slots=True)
class Pass:
    """One run through a recording, from its start or a jump to the next jump or the end.

    Attributes:
        begun_ns: When it began, ns since 1970; later than that of the pass before.
        due_ns: Returns when a moment of the recording is due, ns since 1970.
    """

    begun_ns: int
    due_ns: Callable[[int], int]


@dataclass(frozen=True, slots=True)
class Names:
    """The names under which a recording is played.

    Attributes:
        cameras: New name of each camera that is renamed.
        namespaces: New name of each namespace that is renamed.
    """

    cameras: Mapping[str, str] = field(default_factory=dict)
    namespaces: Mapping[str, str] = field(default_factory=dict)

    def key(self, key: str) -> str:
        """Return the key under which the samples of a key are played."""
        chunks = key.split("/")
        at = "@" if chunks[0].startswith("@") else ""
        namespace = chunks[0].removeprefix("@")
        chunks[0] = at + self.namespaces.get(namespace, namespace)
        if not at and len(chunks) > 2:
            chunks[1] = self.cameras.get(chunks[1], chunks[1])
        return "/".join(chunks)


@dataclass(frozen=True, slots=True)
class Sent:
    """What a replay sends of a record."""

    key: str
    payload: bytes
    attachment: bytes | None


class Replayed:
    """Makes samples of records.

    The bytes of a payload stay as they are, unless a camera is renamed or the stamps are renewed.

    Args:
        names: The new names.
        mark: Whether the header in an attachment says that, and when, a replay sent it.
        lockstep: Whether the header says that the answer is waited for.
        renew: Whether stamps and epochs become those of now, as of a live camera; without a mark.
    """

    def __init__(
        self, names: Names, *, mark: bool = True, renew: bool = False, lockstep: bool = False
    ) -> None:
        self._names = names
        self._mark = mark and not renew
        self._renew = renew
        self._lockstep = lockstep
        self._epochs: dict[object, int] = {}
        self._shifts: OrderedDict[object, int] = OrderedDict()
        self._begun_ns = 0

    def sample(self, record: Record, run: Pass, now_ns: int) -> Sent:
        """Return the sample of a record in a pass; ``now_ns`` is when it is sent, since 1970."""
        if run.begun_ns != self._begun_ns:
            self._begun_ns = run.begun_ns
            self._epochs.clear()
            self._shifts.clear()
        key, header = self._names.key(record.key), record.header
        if not _is_header(header):
            return Sent(key, record.payload, record.attachment)
        shift_ns = self._shift_ns(header, record, run) if self._renew else 0
        changes = self._changes(header, run, shift_ns)
        payload = record.payload
        if changes and not record.deleted and keys.schema_name_of(record.encoding):
            payload = _with_header(payload, changes, shift_ns)
        if self._mark:
            changes |= {"replay": run.begun_ns, "replayed_ns": now_ns}
        if self._lockstep:
            changes["lockstep"] = True
        if not changes:
            return Sent(key, payload, record.attachment)
        return Sent(key, payload, msgpack.packb(header | changes))

    def _changes(self, header: dict[str, Any], run: Pass, shift_ns: int) -> dict[str, Any]:
        """Return the fields of a header that change, with their new values."""
        camera = header["camera"]
        renamed = self._names.cameras.get(camera, camera)
        changes: dict[str, Any] = {} if renamed == camera else {"camera": renamed}
        if changes and header.get("origin") is not None:
            changes["origin"] = None  # a camera of its own now
        if self._renew:
            epoch = (camera, header["epoch"])
            number = self._epochs.setdefault(epoch, len(self._epochs))
            changes["epoch"] = run.begun_ns + number
            changes |= _shifted(header, shift_ns)
        return changes

    def _shift_ns(self, header: dict[str, Any], record: Record, run: Pass) -> int:
        """Return by how much the times of a frame, and of all that was made from it, move."""
        frame = header["camera"], header["epoch"], header["seq"]
        if frame not in self._shifts:
            self._shifts[frame] = run.due_ns(record.log_time_ns) - record.log_time_ns
            if len(self._shifts) > MOST_SHIFTS:
                self._shifts.popitem(last=False)
        return self._shifts[frame]


def _is_header(fields: dict[str, Any]) -> bool:
    numbers = (fields.get(name) for name in ("epoch", "seq", "stamp_ns"))
    return isinstance(fields.get("camera"), str) and all(type(each) is int for each in numbers)


def _shifted(fields: dict[str, Any], shift_ns: int) -> dict[str, Any]:
    return {
        name: min(max(0, fields[name] + shift_ns), MAX_TIME_NS)
        for name in TIMES
        if type(fields.get(name)) is int
    }


def _with_header(payload: bytes, changes: dict[str, Any], shift_ns: int) -> bytes:
    """Return a msgpack message with changes in its header; another payload as it is."""
    try:
        fields = unpack(payload)
    except PayloadError:
        return payload
    if not isinstance(fields, dict) or not isinstance(fields.get("header"), dict):
        return payload
    fields["header"] = fields["header"] | changes
    if shift_ns:
        fields |= _shifted(fields, shift_ns)
    return bytes(msgpack.packb(fields))
