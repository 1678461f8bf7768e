"""What the trackers of regions and of boxes have in common: the objects, their ids, their time."""

from __future__ import annotations

import math
from typing import Final, Generic, TypeVar

from zv.tracker.tracking.measuring import Moment
from zv.tracker.tracking.region import Region
from zv.tracker.tracking.state import TrackState
from zv.tracker.tracking.track import State, Track

MAX_STEP_S: Final = 60.0
"""Positions are predicted for at most this time, even if the clock was set forward by more: a
larger variance would exhaust the precision of floating-point numbers."""

MAX_TRACKS: Final = 400
"""Further objects are not tracked, so that the time for a frame is bounded."""

SMOOTHED: Final = 0.1
"""A track's position is the smoothed centre if that is within this distance, in sides, of the
centre of its box."""

Kind = TypeVar("Kind", bound=TrackState)


class TrackerBase(Generic[Kind]):
    """The objects of one camera. All times are in seconds of the frames' stamps.

    Args:
        kind: The class of their states.
        size: Width and height of the picture, in pixels of which all lengths are.
        scale: Full-resolution pixels per pixel of these.
        first_id: Id of the first track; each further one gets the next number.

    Attributes:
        states: The state of each track, oldest first.
        next_id: The id that the next new track gets.
    """

    def __init__(
        self, kind: type[Kind], size: tuple[int, int], scale: float, first_id: int
    ) -> None:
        self.states: list[Kind] = []
        self.next_id = first_id
        self._kind = kind
        self._scale = scale
        self._moment = Moment(0.0, 0.0, size)

    @property
    def margin(self) -> float:
        """Width of the border of the picture, in pixels of the states."""
        return self._moment.margin

    def predict(self, now_s: float) -> None:
        """Predict all tracks to the time of the next frame; it never goes back."""
        dt_s = max(0.0, now_s - self._moment.now_s)
        self._moment = Moment(now_s, dt_s, self._moment.size)
        for state in self.states:
            state.predict(min(dt_s, MAX_STEP_S))

    def drop(self, state: Kind) -> None:
        """End a track."""
        self.states = [each for each in self.states if each is not state]

    def _new(self, region: Region) -> Kind | None:
        """Begin a track; None if there are too many."""
        if len(self.states) >= MAX_TRACKS:
            return None
        moment = self._moment
        state = self._kind.new(self.next_id, region, moment.now_s, moment.cut(region))
        self.next_id += 1
        self.states.append(state)
        return state

    def _shown_s(self, _: Kind) -> float:
        """Return for how long a confirmed track that is not seen is not yet lost."""
        return 0.0

    def _track(self, state: Kind) -> Track:
        scale, box, now_s = self._scale, state.shown or state.box, self._moment.now_s
        width, height = max(1, round(box.width * scale)), max(1, round(box.height * scale))
        x, y = state.x.position, state.y.position
        if math.dist((x, y), box.center) > SMOOTHED * state.side:
            x, y = box.center
        missing_s = state.missing_s(now_s)
        seen: State = "confirmed" if missing_s <= self._shown_s(state) else "lost"
        return Track(
            id=state.id,
            state=seen if state.confirmed else "tentative",
            x=x * scale,
            y=y * scale,
            box=(round(box.left * scale), round(box.top * scale), width, height),
            area=max(0.0, state.area) * scale * scale,
            vx=state.x.velocity * scale,
            vy=state.y.velocity * scale,
            age_s=max(0.0, now_s - state.born_s),
            missing_s=missing_s,
            steady=state.steady and (state.steady[0] * scale, state.steady[1] * scale),
            offset=(state.offset[0] * scale, state.offset[1] * scale),
            class_name=state.class_name,
            score=state.score,
        )
