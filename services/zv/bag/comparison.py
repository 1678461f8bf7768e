"""Compares what a service says of a frame with what was recorded, field by field."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Final

import numpy as np

from zenoh_vision.errors import PayloadError
from zenoh_vision.image.files import decoded
from zenoh_vision.keys import schema_name_of
from zenoh_vision.message_codec import unpack
from zv.bag.record import Record

NOT_COMPARED: Final = (
    "header.node",
    "header.revision",
    "header.received_ns",
    "header.done_ns",
    "header.replay",
    "header.replayed_ns",
    "header.lockstep",
)
"""Fields that say when and by whom a message was made, not what is in it."""

ALMOST: Final = 1e-9
"""Tolerance of a float without one of its own, relative and absolute: the last digits depend on the
processor and on the libraries."""

MISSING: Final = "missing"
PIXELS: Final = "pixels"
"""Name of the field of a picture: the share of the pixels that differ."""


@dataclass(frozen=True, slots=True)
class Difference:
    """The first field that differs in the answers to one frame.

    Attributes:
        key: Of the message.
        field: Dotted name: ``tracks.0.x``; empty for the message as a whole.
        recorded, now: Both values; ``missing`` where there is none.
        tolerance: By how much they may differ; None where they must be equal.
    """

    key: str
    field: str
    recorded: Any
    now: Any
    tolerance: float | None = None

    def text(self) -> str:
        """Return what differs, in words."""
        what = f"{self.key}: {self.field}" if self.field else self.key
        within = f" (tolerance {self.tolerance:g})" if self.tolerance else ""
        return f"{what}: recorded {_shown(self.recorded)}, now {_shown(self.now)}{within}"


@dataclass(frozen=True, slots=True)
class Tolerances:
    """By how much numbers may differ.

    Attributes:
        general: Of all floats; None for ``ALMOST``.
        by_field: Of the numbers of a field, whole numbers too. Names leave out positions in lists:
            ``tracks.x``. The name of a part holds for what is in it.
        ignored: Fields that are not compared, named in the same way.
    """

    general: float | None = None
    by_field: Mapping[str, float] = field(default_factory=dict)
    ignored: frozenset[str] = frozenset()

    def of(self, name: str) -> float | None:
        """Return the tolerance of a field; None if it has none of its own."""
        return next((self.by_field[each] for each in _parts(name) if each in self.by_field), None)

    def ignores(self, name: str) -> bool:
        """Tell whether a field is not compared."""
        return name in NOT_COMPARED or any(each in self.ignored for each in _parts(name))


def first_difference(
    recorded: Sequence[Record], now: Sequence[Record], tolerances: Tolerances
) -> Difference | None:
    """Return the first difference between the answers to a frame, None if they are the same.

    Answers on one key are compared in their order; that of the keys does not matter.
    """
    keys = list(dict.fromkeys(each.key for each in (*recorded, *now)))
    for key in keys:
        before = [each for each in recorded if each.key == key]
        after = [each for each in now if each.key == key]
        for one, other in zip(before, after, strict=False):
            found = _of_records(one, other, tolerances)
            if found is not None:
                return found
        if len(before) > len(after):
            return Difference(key, "", values_of(before[len(after)]), MISSING)
        if len(after) > len(before):
            return Difference(key, "", MISSING, values_of(after[len(before)]))
    return None


def values_of(record: Record) -> Any:
    """Return a message's fields; of another payload, how long it is."""
    if schema_name_of(record.encoding) and "msgpack" in record.encoding:
        try:
            return unpack(record.payload)
        except PayloadError:
            pass
    return f"{len(record.payload)} bytes of {record.encoding or 'unknown encoding'}"


def _of_records(recorded: Record, now: Record, tolerances: Tolerances) -> Difference | None:
    if recorded.encoding != now.encoding:
        return Difference(recorded.key, "encoding", recorded.encoding, now.encoding)
    if recorded.payload == now.payload:
        return None
    if recorded.encoding.startswith("image/"):
        return _of_pictures(recorded, now, tolerances)
    before, after = values_of(recorded), values_of(now)
    if isinstance(before, str) or isinstance(after, str):
        return Difference(recorded.key, "payload", before, after)
    for name, one, other in differing(before, after):
        plain = ".".join(part for part in name.split(".") if not part.isdecimal())
        if tolerances.ignores(plain):
            continue
        allowed = tolerances.of(plain)
        if not _alike(one, other, allowed, tolerances.general):
            shown = allowed if allowed is not None else tolerances.general
            return Difference(recorded.key, name, one, other, shown)
    return None


def differing(one: object, other: object, name: str = "") -> Iterator[tuple[str, Any, Any]]:
    """Yield the dotted name and both values of each innermost field that is not equal."""
    if isinstance(one, Mapping) and isinstance(other, Mapping):
        for each in dict.fromkeys((*one, *other)):
            inner = f"{name}.{each}" if name else str(each)
            # A field that is left out is nil.
            yield from differing(one.get(each), other.get(each), inner)
    elif isinstance(one, (list, tuple)) and isinstance(other, (list, tuple)):
        for number in range(max(len(one), len(other))):
            before = one[number] if number < len(one) else MISSING
            after = other[number] if number < len(other) else MISSING
            yield from differing(before, after, f"{name}.{number}")
    elif type(one) is not type(other) or one != other:
        yield name, one, other


def _alike(one: object, other: object, allowed: float | None, general: float | None) -> bool:
    if isinstance(one, bool) or isinstance(other, bool):
        return one is other
    if not isinstance(one, (int, float)) or not isinstance(other, (int, float)):
        return False
    if allowed is not None:
        return abs(one - other) <= allowed
    if isinstance(one, int) and isinstance(other, int):
        return one == other
    if general is not None:
        return abs(one - other) <= general
    return math.isclose(one, other, rel_tol=ALMOST, abs_tol=ALMOST)


def _of_pictures(recorded: Record, now: Record, tolerances: Tolerances) -> Difference | None:
    if tolerances.ignores(PIXELS):
        return None
    try:
        before, after = decoded(recorded.payload).pixels, decoded(now.payload).pixels
    except (ValueError, PayloadError) as error:
        return Difference(recorded.key, "payload", values_of(recorded), str(error))
    if before.shape != after.shape:
        return Difference(recorded.key, "size", before.shape, after.shape)
    unequal = before != after
    share = float(np.mean(unequal.any(axis=2) if unequal.ndim == 3 else unequal))
    allowed = tolerances.of(PIXELS) or 0.0
    if share <= allowed:
        return None
    return Difference(recorded.key, PIXELS, 0.0, share, allowed)


def _parts(name: str) -> Iterator[str]:
    """Yield a dotted name, then the names of the parts that it is in."""
    while name:
        yield name
        name = name.rpartition(".")[0]


def _shown(value: object) -> str:
    text = value if isinstance(value, str) else repr(value)
    return text if len(text) <= 200 else f"{text[:197]}..."
