"""Tracks the objects of a model's boxes from frame to frame, and by their motion in between."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

from zv.tracker.tracking import boxes
from zv.tracker.tracking.base import TrackerBase
from zv.tracker.tracking.box_association import BoxLimits, ScoredBox, match_boxes
from zv.tracker.tracking.region import Region
from zv.tracker.tracking.state import BoxState
from zv.tracker.tracking.track import Track

REMEMBERED_S: Final = 2.0
"""Results of the model for frames that are older than this are of no use."""

Center = tuple[float, float]


@dataclass(frozen=True, slots=True)
class BoxLife:
    """The constants of a track's life; seconds of stamps."""

    hits: float = 3.0  # a track is confirmed when the model has been sure of it so many times,
    clear: float = 0.5  # where a score so far between the least one and 1 counts
    clear_hits: float = 1.5  # as so many
    # One that was never confirmed ends if it is not found for longer than this.
    tentative_s: float = 0.3
    # A confirmed one that is not seen for longer than this is lost; at the border of the picture,
    # where it may have left, at once.
    shown_s: float = 0.3
    # It is shown so at most for this share of the time for which it was followed before.
    proven: float = 0.5
    # It ends if it is not found for longer than this and than it was followed; at the border for
    # longer than this alone.
    brief_s: float = 1.0
    runs: int = 2  # no track ends before so many runs of the model have not found it
    # Time constant with which the predicted motion of what is not seen slows down.
    hidden_s: float = 1.0
    # An object without motion is where it was if its speed is below this, sides per second.
    still: float = 0.3
    # Its region of motion may differ in width and height by this factor from one frame to the
    # next.
    alike: float = 1.25
    # Share of the evidence for a class that is left after each run of the model.
    fading: float = 0.9


class BoxTracker(TrackerBase[BoxState]):
    """Turns boxes of a model, and regions of motion, into tracks; see ``TrackerBase``."""

    def __init__(self, size: tuple[int, int], first_id: int = 1, keep_lost_s: float = 2.0) -> None:
        super().__init__(BoxState, size, 1.0, first_id)
        self.keep_lost_s = keep_lost_s
        self._life = BoxLife()
        self._limits = BoxLimits()
        self._places: deque[tuple[float, dict[int, Center]]] = deque()

    def see(self, found: Sequence[ScoredBox]) -> None:
        """Process the boxes of the frame to which the tracks were predicted."""
        self._associate(found, self.states, {})

    def see_late(self, found: Sequence[ScoredBox], at_s: float) -> bool:
        """Process the boxes of an earlier frame: each moves as its track has moved since.

        Returns:
            Whether that frame is remembered; if not, nothing has changed.
        """
        then = next((places for time_s, places in self._places if time_s == at_s), None)
        if then is None:
            return False
        known = [each for each in self.states if each.id in then]
        moved: dict[int, Center] = {}
        for state in known:
            x0, y0 = then[state.id]
            moved[state.id] = state.x.position - x0, state.y.position - y0
        self._associate(found, known, moved)
        self._places[-1] = self._places[-1][0], self._centers()
        return True

    def move(self, regions: Sequence[Region], *, seen: bool = True) -> None:
        """Follow the tracks by the regions of motion of a frame.

        Args:
            regions: What moves, in pixels of the picture.
            seen: Whether the tracks are to be moved, since the model did not see this frame.
        """
        links = boxes.overlaps([each.box for each in self.states], regions) > 0.3
        for row, state in enumerate(self.states):
            columns = [column for column in range(len(regions)) if links[row, column]]
            before, state.motion = state.motion, None
            if len(columns) == 1 and int(links[:, columns[0]].sum()) == 1:
                state.motion = regions[columns[0]]
            if not seen and state.missed == 0:
                continue  # the model has measured it
            if seen and before and state.motion and self._alike(before, state.motion):
                (x, y), (x1, y1), (x0, y0) = state.place, state.motion.center, before.center
                state.place = x + x1 - x0, y + y1 - y0
                state.correct(state.place, self._moment.now_s)
                continue
            if seen and not columns and state.speed < self._life.still:
                state.slow_down(0.0)
                if state.missed == 0:
                    state.seen_s = self._moment.now_s
            state.place = state.x.position, state.y.position

    def finish(self) -> list[Track]:
        """End what was not seen for long, and return the tracks at the time of the frame."""
        life, now_s = self._life, self._moment.now_s
        kept = []
        for state in self.states:
            state.confirmed |= state.missed == 0 and state.found >= life.hits
            kept_s = life.tentative_s
            if state.confirmed:
                followed_s = 0.0 if self._leaving(state) else state.seen_s - state.born_s
                kept_s = min(self.keep_lost_s, max(life.brief_s, followed_s))
            if state.missing_s(now_s) > 0:
                state.slow_down(math.exp(-self._moment.dt_s / life.hidden_s))
            if state.missing_s(now_s) <= kept_s or state.missed < life.runs:
                kept.append(state)
        self.states = kept
        self._places.append((now_s, self._centers()))
        while self._places[0][0] < now_s - REMEMBERED_S:
            self._places.popleft()
        return [self._track(each) for each in kept]

    def _associate(
        self,
        found: Sequence[ScoredBox],
        states: Sequence[BoxState],
        moved: Mapping[int, Center],
    ) -> None:
        states, moves = list(states), [moved.get(each.id, (0.0, 0.0)) for each in states]
        expected = [each.box.moved(-dx, -dy) for each, (dx, dy) in zip(states, moves, strict=True)]
        pairs, new = match_boxes(states, expected, found, self._limits)
        for state in states:
            state.missed += 1
        for row, column in pairs:
            self._measure(states[row], found[column], moves[row])
        for column in new:
            self._begin(found[column])

    def _centers(self) -> dict[int, Center]:
        return {each.id: (each.x.position, each.y.position) for each in self.states}

    def _measure(self, state: BoxState, found: ScoredBox, moved: Center) -> None:
        region = found.region
        state.resize(region.width, region.height, region.area, 1.0)
        (x, y), (dx, dy) = region.center, moved
        state.place = x + dx, y + dy
        state.correct(state.place, self._moment.now_s)
        for name in state.evidence:
            state.evidence[name] *= self._life.fading
        self._classify(state, found)

    def _begin(self, found: ScoredBox) -> None:
        state = self._new(found.region)
        if state is not None:
            state.place = found.region.center
            self._classify(state, found)

    def _classify(self, state: BoxState, found: ScoredBox) -> None:
        """Count a run that found an object, with its score, and take its likeliest class."""
        if found.score >= found.least:
            is_clear = found.score - found.least >= self._life.clear * (1 - found.least)
            state.found += self._life.clear_hits if is_clear else 1.0
        state.evidence[found.name] = state.evidence.get(found.name, 0.0) + found.score
        state.class_name = max(state.evidence, key=state.evidence.__getitem__)
        state.missed, state.score = 0, found.score

    def _alike(self, one: Region, other: Region) -> bool:
        ratios = one.width / max(1e-6, other.width), one.height / max(1e-6, other.height)
        return all(1 / self._life.alike < ratio < self._life.alike for ratio in ratios)

    def _leaving(self, state: BoxState) -> bool:
        """Return whether an object is expected at the border of the picture, or outside of it."""
        (width, height), box = self._moment.size, state.box
        return box.left <= 1 or box.top <= 1 or box.right >= width - 1 or box.bottom >= height - 1

    def _shown_s(self, state: BoxState) -> float:
        followed_s = state.seen_s - state.born_s
        limit_s = min(self._life.shown_s, self._life.proven * followed_s)
        return 0.0 if self._leaving(state) else limit_s
