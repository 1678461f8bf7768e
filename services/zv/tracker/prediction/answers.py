"""Answers queries for predicted positions of one camera's objects."""

from __future__ import annotations

import threading
import time
from collections.abc import Mapping, Sequence

from zenoh_vision import Header, Node, ParameterRefused, Prediction
from zenoh_vision.calibration.plane_view import PlaneView
from zenoh_vision.error_text import shortened
from zenoh_vision.topics import PREDICTION
from zv.tracker.events.sighting import Anchor
from zv.tracker.prediction.forecast import LEAST_POSITIONS, TooShort
from zv.tracker.prediction.paths import Paths, Point
from zv.tracker.tracking.track import Track

AHEAD_NS = 10 * 10**9
MAX_IDS = 20
PARAMETERS = "id, and ahead_ms or at_ns"


class PredictionAnswers:
    """Keeps the paths of one camera's objects and answers queries with predictions."""

    def __init__(self, node: Node, camera: str) -> None:
        self._node = node
        self._paths = Paths("centre")
        self._header: Header | None = None
        self._view: PlaneView | None = None
        self._lock = threading.Lock()  # queries have a thread of their own
        node.answer(PREDICTION, self.answer, camera=camera)

    def update(
        self, header: Header, tracks: Sequence[Track], anchor: Anchor, view: PlaneView | None
    ) -> None:
        """Process all tracks of the next frame.

        Args:
            header: Header of the frame's results; a new epoch forgets all paths.
            tracks: All tracks of the frame.
            anchor: The point of an object whose world position is wanted.
            view: The mapping to the plane; None without one.
        """
        with self._lock:
            former = self._header
            if former is None or former.run != header.run or self._paths.anchor != anchor:
                self._paths = Paths(anchor)
            self._header, self._view = header, view
            self._paths.update(tracks, header.stamp_ns)

    def trails(self) -> dict[int, list[Point]]:
        """Return the last centres of each object in the newest frame, as ``Paths.trails`` does."""
        return {} if self._header is None else self._paths.trails(self._header.stamp_ns)

    def answer(self, parameters: Mapping[str, str]) -> Prediction:
        """Return the prediction that a query asks for.

        Raises:
            ParameterRefused: A parameter is invalid, or there is no such track; the text says what
                is allowed.
        """
        for name in parameters:
            if name not in ("id", "ahead_ms", "at_ns"):
                raise ParameterRefused(f"unknown parameter {shortened(name)}", PARAMETERS)
        id_ = _number(parameters, "id", "the id of a track, a whole number")
        with self._lock:
            header = self._header
            track = self._paths.track(id_)
            if header is None or track is None:
                ids = self._paths.ids
                listed = ", ".join(map(str, ids[:MAX_IDS])) or "none is followed now"
                raise ParameterRefused(
                    f"no track {id_} now", listed + (", ..." if len(ids) > MAX_IDS else "")
                )
            at_ns = _time(parameters, header.stamp_ns)
            try:
                found = self._paths.predict(id_, at_ns, self._view)
            except TooShort as error:
                words = f"tracks that were seen in {LEAST_POSITIONS} frames"
                raise ParameterRefused(f"track {id_} was {error} only", words) from None
        return Prediction(header=header, id=id_, state=track.state, stamp_ns=at_ns, **vars(found))


def _time(parameters: Mapping[str, str], newest_ns: int) -> int:
    """Return the time that a query asks for, in ns by the clock of the stamps."""
    if ("ahead_ms" in parameters) == ("at_ns" in parameters):
        raise ParameterRefused("either ahead_ms or at_ns must be given", PARAMETERS)
    if "at_ns" in parameters:
        at_ns = _number(parameters, "at_ns", "nanoseconds since 1970, a whole number")
    else:
        ahead_ms = _number(parameters, "ahead_ms", "milliseconds, a whole number from 0 to 10000")
        at_ns = max(newest_ns, time.time_ns() + ahead_ms * 1_000_000)
    if not newest_ns <= at_ns <= newest_ns + AHEAD_NS:
        raise ParameterRefused(
            f"{at_ns} is {(at_ns - newest_ns) / 1e9:+.3f} s from the newest frame",
            f"at_ns from {newest_ns} to {newest_ns + AHEAD_NS}: up to 10 s after it",
        )
    return at_ns


def _number(parameters: Mapping[str, str], name: str, allowed: str) -> int:
    text = parameters.get(name)
    if text is None:
        raise ParameterRefused(f"{name} is missing", PARAMETERS)
    if not (text.isascii() and text.isdecimal() and len(text) <= 19):
        raise ParameterRefused(f"{name} = {shortened(text)}", allowed)
    return int(text)
