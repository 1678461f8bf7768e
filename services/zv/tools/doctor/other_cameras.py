"""Cameras that are not nodes: plain Zenoh programs that publish pictures, listed by the routers."""

from __future__ import annotations

import time
from dataclasses import dataclass

import zenoh

from zenoh_vision.keys import camera_of, is_name
from zenoh_vision.topics import COMPRESSED, RAW, topic_of
from zenoh_vision.transport.link import Declaration
from zv.tools.shared.discovery import Discovery
from zv.tools.shared.session import ToolSession

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
        self._times_s: dict[str, list[float]] = {key: [] for key in counted[:MAX_CAMERAS]}
        self._begun_s = time.monotonic()
        self._subscriptions = [self._count(session, key) for key in self._times_s]

    def close(self) -> tuple[OtherCamera, ...]:
        """Unsubscribe, and return the cameras that declared a publisher or sent frames."""
        span_s = time.monotonic() - self._begun_s
        for each in self._subscriptions:
            each.undeclare()
        return tuple(
            OtherCamera(key, len(times_s), span_s, _rate_hz(times_s))
            for key, times_s in sorted(self._times_s.items())
            if times_s or key in self._declared
        )

    def _count(self, session: ToolSession, key: str) -> Declaration[zenoh.Subscriber[None]]:
        times_s = self._times_s[key]

        def count(sample: zenoh.Sample) -> None:
            if sample.kind == zenoh.SampleKind.PUT:
                times_s.append(time.monotonic())

        return session.subscribe(key, count)


def _is_of_frames(key: str) -> bool:
    """Tell whether a key is that of a camera's frames; anyone can declare any key."""
    return topic_of(key) in (COMPRESSED, RAW) and is_name(camera_of(key)) and len(key) <= MAX_KEY


def _rate_hz(times_s: list[float]) -> float | None:
    span_s = times_s[-1] - times_s[0] if times_s else 0.0
    return (len(times_s) - 1) / span_s if span_s > 0 else None
