"""Cameras that are not nodes: plain Zenoh programs that publish pictures, listed by the routers."""

from __future__ import annotations

import time
from dataclasses import dataclass

from zenoh_vision.keys import camera_of, is_name
from zenoh_vision.topics import is_frame_key
from zv.tools.shared.discovery import Discovery
from zv.tools.shared.session import ToolSession
from zv.tools.shared.statistics import StreamMonitor, rate_of_parts

MAX_CAMERAS = 20
"""Most streams that are counted, since raw pixels may be a heavy load."""

MAX_KEY = 200
"""Most characters of a key."""


@dataclass(frozen=True, slots=True)
class OtherCamera:
    """A stream of frames whose publisher is not a node.

    Attributes:
        arrived: How many samples arrived.
        span_s: Seconds over which they were counted.
        rate_hz: Frames per second; None if fewer than two arrived.
    """

    key: str
    arrived: int
    span_s: float
    rate_hz: float | None = None

    @property
    def camera(self) -> str:
        """The camera's name."""
        return camera_of(self.key)


class ArrivalCounter:
    """Counts the frames of the cameras that are not nodes, from its creation on.

    Streams without a declared publisher are found if someone else subscribes to them.

    ``update`` must be called about once a second.

    Attributes:
        left_out: How many declared cameras are not counted, since there are too many.
    """

    def __init__(self, session: ToolSession, found: Discovery) -> None:
        known = {key for key in found.keys() | found.subscribers.keys() if _is_of_frames(key)}
        mine = {key for key in known if key.startswith(f"{session.namespace}/")}
        declared = {key for key in mine if found.others_publish(key)}
        undeclared = {key for key in mine if not found.publisher_count(key)}
        counted = [*sorted(declared), *sorted(undeclared)]
        self.left_out = max(0, len(declared) - MAX_CAMERAS)
        self._declared = declared
        self._keys = counted[:MAX_CAMERAS]
        self._begun_s = time.monotonic()
        self._monitor = StreamMonitor(session, self._keys)
        self.update = self._monitor.update

    def close(self) -> tuple[OtherCamera, ...]:
        """Unsubscribe, and return the cameras that declared a publisher or sent frames."""
        now_s = time.monotonic()
        self._monitor.close()
        self.update()
        found = []
        for key in sorted(self._keys):
            parts = [each.samples for each in self._monitor.streams if each.key == key]
            if parts or key in self._declared:
                count = sum(part.count for part in parts)
                rate_hz = rate_of_parts(parts, self._begun_s, now_s) if parts else None
                found.append(OtherCamera(key, count, now_s - self._begun_s, rate_hz))
        return tuple(found)


def _is_of_frames(key: str) -> bool:
    """Tell whether a key is that of a camera's frames; anyone can declare any key."""
    return is_frame_key(key) and is_name(camera_of(key)) and len(key) <= MAX_KEY
