"""A picture and what was found in it: joined by epoch and seq, as both come."""

from __future__ import annotations

import threading
from collections import OrderedDict
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from typing import TypeVar

import zenoh

from common.errors import ConfigurationError, ExpectationNotMet, PayloadError
from common.keys import CENTROID, TRACKS
from common.messages import Centroid, Tracks
from services.tools.session import ToolSession
from services.tools.snapshot.shot import Shot, shot_of
from services.tools.survey import survey
from services.tools.types import camera_of, topic_of

MOST_FRAMES = 64
"""Frames that are kept until their other half comes: two seconds at 30 Hz."""

Frame = tuple[int, int]
"""Epoch and seq."""

M = TypeVar("M", Centroid, Tracks)


@dataclass(slots=True)
class Pair:
    """A picture and what was found in it."""

    shot: Shot | None = None
    centroid: Centroid | None = None
    tracks: Tracks | None = None


@dataclass
class Join:
    """Collects pictures and results of a camera until some belong together.

    Attributes:
        wanted: Names of the results without which a frame is not complete.
    """

    camera: str
    wanted: frozenset[str]
    _pairs: OrderedDict[Frame, Pair] = field(default_factory=OrderedDict)
    _lock: threading.Lock = field(default_factory=threading.Lock)

    def add(
        self,
        frame: Frame,
        *,
        shot: Shot | None = None,
        centroid: Centroid | None = None,
        tracks: Tracks | None = None,
    ) -> None:
        """Add a part of a frame."""
        with self._lock:
            pair = self._pairs.setdefault(frame, Pair())
            pair.shot = shot or pair.shot
            pair.centroid = centroid or pair.centroid
            pair.tracks = tracks or pair.tracks
            while len(self._pairs) > MOST_FRAMES:
                self._pairs.popitem(last=False)

    def complete(self) -> Pair | None:
        """Return the newest frame with its picture and all results that are wanted."""
        with self._lock:
            return self._newest(
                lambda pair: all(getattr(pair, name) is not None for name in self.wanted)
            )

    def incomplete(self) -> Pair | None:
        """Return the newest frame with its picture and at least one result."""
        with self._lock:
            return self._newest(lambda pair: bool(pair.centroid or pair.tracks))

    def _newest(self, is_enough: Callable[[Pair], bool]) -> Pair | None:
        found = [
            (frame, pair)
            for frame, pair in self._pairs.items()
            if pair.shot is not None and is_enough(pair)
        ]
        return max(found, key=lambda each: each[0])[1] if found else None


def join(session: ToolSession, key: str, patience_s: float) -> Pair | None:
    """Return the first frame of a key of which picture and results have come.

    Returns:
        None if told to stop.

    Raises:
        ConfigurationError: The key is not that of a camera's pictures.
        ExpectationNotMet: Nothing came that belongs together.
    """
    if topic_of(key) is None:
        raise ConfigurationError(f"--draw: {key} is no key of the topic table with a camera in it")
    camera, namespace = camera_of(key), key.split("/")[0]
    found = survey(session)
    keys = {topic.name: topic.key(namespace, camera) for topic in (CENTROID, TRACKS)}
    published = frozenset(name for name, result in keys.items() if found.keys(result))
    if not published:
        raise ExpectationNotMet(
            f"--draw: nobody publishes {' or '.join(keys.values())}; does a tracker run?"
        )
    joined = Join(camera, published)
    session.subscribe(keys["centroid"], _taker(joined, "centroid", Centroid))
    session.subscribe(keys["tracks"], _taker(joined, "tracks", Tracks))
    session.subscribe(key, partial(_take_picture, joined))
    if not session.wait(patience_s, until=lambda: joined.complete() is not None):
        return None
    pair = joined.complete() or joined.incomplete()
    if pair is None:
        raise ExpectationNotMet(
            f"--draw: no picture on {key} and {' or '.join(sorted(published))} "
            f"of the same frame within {patience_s:g} s"
        )
    return pair


def _take_picture(joined: Join, sample: zenoh.Sample) -> None:
    try:
        shot = shot_of(sample)
    except (ConfigurationError, ExpectationNotMet):
        return  # the next one may do
    if shot.header is not None:
        joined.add((shot.header.epoch, shot.header.seq), shot=shot)


def _taker(joined: Join, name: str, kind: type[M]) -> Callable[[zenoh.Sample], None]:
    def take(sample: zenoh.Sample) -> None:
        try:
            message = kind.from_bytes(sample.payload.to_bytes())
        except PayloadError:
            return
        header = message.header
        if header.camera == joined.camera:
            joined.add((header.epoch, header.seq), **{name: message})  # type: ignore[arg-type]

    return take
