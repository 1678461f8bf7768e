"""Which events are sent, and ``Notice``: one event as it is sent, with its picture."""

from __future__ import annotations

from collections import OrderedDict
from dataclasses import dataclass
from typing import Any

from zenoh_vision.messages import TrackEvent


@dataclass(frozen=True, slots=True)
class Notice:
    """An event, and the picture of its camera when it came.

    Attributes:
        fields: For JSON; times in ns as integers.
        picture: JPEG or PNG; empty without one.
        mime: Of the picture.
        announced: Whether the event is sent; else only the state of its zone is.
    """

    fields: dict[str, Any]
    picture: bytes = b""
    mime: str = "image/jpeg"
    announced: bool = True

    @property
    def id(self) -> str:
        """Identifies the event, so that a receiver can tell a second delivery."""
        return str(self.fields["uid"])

    @property
    def camera(self) -> str:
        """The camera's name."""
        return str(self.fields["camera"])


def fields_of(event: TrackEvent, received_ns: int) -> dict[str, Any]:
    """Return an event as fields for JSON."""
    header = event.header
    parts = (header.camera, header.epoch, header.seq, event.event, event.id, event.zone or "")
    found = {
        "uid": "-".join(map(str, parts)),
        "camera": header.camera,
        "event": event.event,
        "id": event.id,
        "zone": event.zone,
        "direction": event.direction,
        "x": event.x,
        "y": event.y,
        "stamp_ns": event.stamp_ns or header.stamp_ns,
        "received_ns": received_ns,
        "epoch": header.epoch,
        "seq": header.seq,
        "count": event.count,
        "inside": event.inside,
        "dwell_s": event.dwell_s,
    }
    return {name: value for name, value in found.items() if value is not None}


MOST_KNOWN = 5000


class Choice:
    """Remembers the events that arrived and were sent; uses no clock."""

    def __init__(self) -> None:
        self._arrived: OrderedDict[tuple[object, ...], None] = OrderedDict()
        self._last_s: OrderedDict[tuple[str, str, str | None], float] = OrderedDict()

    def is_new(self, event: TrackEvent) -> bool:
        """Tell whether an event arrives for the first time."""
        header = event.header
        name = (header.camera, header.epoch, header.seq, event.event, event.id, event.zone)
        if name in self._arrived:
            return False
        if len(self._arrived) >= MOST_KNOWN:
            self._arrived.popitem(last=False)
        self._arrived[name] = None
        return True

    def allow(
        self, event: TrackEvent, kinds: frozenset[str], cooldown_s: float, now_s: float
    ) -> bool:
        """Tell whether to send an event that has arrived at a monotonic time."""
        if event.event not in kinds:
            return False
        place = (event.header.camera, event.event, event.zone)
        last_s = self._last_s.get(place)
        if last_s is not None and now_s - last_s < cooldown_s:
            return False
        if len(self._last_s) >= MOST_KNOWN and place not in self._last_s:
            self._last_s.popitem(last=False)
        self._last_s[place] = now_s
        return True
