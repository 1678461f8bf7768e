"""Tracks the objects of a model's boxes from frame to frame, and by their motion in between."""

from __future__ import annotations

import math
from collections import Counter, deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Final, Literal

from zv.tracker.tracking import boxes
from zv.tracker.tracking.box_association import (
    BoxLimits,
    Expected,
    ScoredBox,
    match_boxes,
)
from zv.tracker.tracking.region import Region
from zv.tracker.tracking.state import TrackState, new_state
from zv.tracker.tracking.track import Track

MAX_STEP_S: Final = 60.0
MAX_TRACKS: Final = 400
REMEMBERED_S: Final = 2.0
"""Results of the model for frames that are older than this are of no use."""

Center = tuple[float, float]


@dataclass(frozen=True, slots=True)
class BoxLife:
    """The constants of a track's life; seconds of stamps.

    Attributes:
        hits: A track is confirmed when the model has been sure of it so many times,
        clear: where a score so far between the least one and 1 counts
        clear_hits: as so many.
        tentative_s: One that was never confirmed ends if it is not found for longer than this,
        tentative_runs: and not in so many runs of the model.
        shown_s: A confirmed track that is not seen for longer than this is lost,
        leaving_s: or than this at the border of the picture.
        border_s: There it ends if it is not seen for longer than this.
        brief_s: Elsewhere, if neither for longer than this nor for longer than it was followed.
        proven: It is shown at most for this share of the time for which it was followed before.
        hidden_s: Time constant with which the predicted motion of a hidden object slows down.
        size_s: Time constant with which the size follows a change,
        noise: unless it is larger than a model's noise: this natural logarithm of the ratio,
        change: and this much more is followed at once.
        still: An object without motion is where it was if its speed is below this, sides per
            second.
        alike: Its region of motion may differ in width and height by this factor from one frame
            to the next.
        fading: Share of the evidence for a class that is left after each run of the model.
    """

    hits: float = 3.0
    clear: float = 0.5
    clear_hits: float = 1.5
    tentative_s: float = 0.3
    tentative_runs: int = 2
    shown_s: float = 0.3
    leaving_s: float = 0.0
    border_s: float = 1.0
    brief_s: float = 1.0
    proven: float = 0.5
    hidden_s: float = 1.0
    size_s: float = 0.2
    noise: float = 0.05
    change: float = 0.1
    still: float = 0.3
    alike: float = 1.25
    fading: float = 0.9


@dataclass(slots=True, eq=False)
class BoxTrack:
    """One object.

    Attributes:
        state: Its motion.
        found: Number of runs of the model that were sure of it; clear ones count more.
        missed: Number of runs that did not, since the last that did.
        evidence: Sum of its scores by class, fading.
        score: The newest one.
        motion: Its region of motion in the last frame; None if it had none of its own.
        place: The centre of its box there, as it was measured.
    """

    state: TrackState
    found: float = 1.0
    missed: int = 0
    evidence: Counter[str] = field(default_factory=Counter)
    score: float = 0.0
    motion: Region | None = None
    place: Center = (0.0, 0.0)

    @property
    def name(self) -> str:
        """The class with the most evidence."""
        return max(self.evidence, key=self.evidence.__getitem__)


class BoxTracker:
    """Turns boxes of a model, and regions of motion, into tracks.

    Args:
        size: Width and height of the picture, in pixels of which all lengths are.
        first_id: Id of the first track; each further one gets the next number.
        keep_lost_s: How long a track that is not seen is kept.
        life: The constants of a track's life.
        limits: Those of association.

    Attributes:
        tracks: The objects, oldest first.
        next_id: The id that the next new track gets.
    """

    def __init__(
        self,
        size: tuple[int, int],
        first_id: int = 1,
        keep_lost_s: float = 2.0,
        life: BoxLife | None = None,
        limits: BoxLimits | None = None,
    ) -> None:
        self.tracks: list[BoxTrack] = []
        self.next_id = first_id
        self.keep_lost_s = keep_lost_s
        self._size = size
        self._life = life or BoxLife()
        self._limits = limits or BoxLimits()
        self._now_s = 0.0
        self._dt_s = 0.0
        self._places: deque[tuple[float, dict[int, Center]]] = deque()

    def predict(self, now_s: float) -> None:
        """Predict all tracks to the time of the next frame; it never goes back."""
        self._dt_s = max(0.0, now_s - self._now_s)
        self._now_s = now_s
        for track in self.tracks:
            track.state.predict(min(self._dt_s, MAX_STEP_S))

    def see(self, found: Sequence[ScoredBox]) -> None:
        """Process the boxes of the frame to which the tracks were predicted."""
        self._associate(found, self.tracks, {})

    def see_late(self, found: Sequence[ScoredBox], at_s: float) -> bool:
        """Process the boxes of an earlier frame: each moves as its track has moved since.

        Returns:
            Whether that frame is remembered; if not, nothing has changed.
        """
        then = next((places for time_s, places in self._places if time_s == at_s), None)
        if then is None:
            return False
        known = [each for each in self.tracks if each.state.id in then]
        moved: dict[int, Center] = {}
        for track in known:
            state = track.state
            (x, y), (x0, y0) = (state.x.position, state.y.position), then[state.id]
            moved[state.id] = x - x0, y - y0
        self._associate(found, known, moved)
        if self._places:
            self._places[-1] = self._places[-1][0], self._centers()
        return True

    def move(self, regions: Sequence[Region], *, seen: bool = True) -> None:
        """Follow the tracks by the regions of motion of a frame.

        Args:
            regions: What moves, in pixels of the picture.
            seen: Whether the tracks are to be moved, since the model did not see this frame.
        """
        links = boxes.overlaps([each.state.box for each in self.tracks], regions) > 0.3
        for row, track in enumerate(self.tracks):
            columns = [column for column in range(len(regions)) if links[row, column]]
            before, track.motion = track.motion, None
            if len(columns) == 1 and int(links[:, columns[0]].sum()) == 1:
                track.motion = regions[columns[0]]
            if not seen and track.missed == 0:
                continue  # the model has measured it
            if seen and self._alike(before, track.motion):
                self._shift(track, before, track.motion)
                continue
            state = track.state
            if seen and not columns and state.speed < self._life.still:
                state.slow_down(0.0)
                if track.missed == 0:
                    state.seen_s = self._now_s
            track.place = state.x.position, state.y.position

    def finish(self) -> list[Track]:
        """End what was not seen for long, and return the tracks at the time of the frame."""
        life = self._life
        kept = []
        for track in self.tracks:
            state = track.state
            missing_s = state.missing_s(self._now_s)
            state.confirmed |= track.missed == 0 and track.found >= life.hits
            if not state.confirmed:
                ended = missing_s > life.tentative_s and track.missed >= life.tentative_runs
            elif self._leaving(state):
                kept_s = min(life.border_s, self.keep_lost_s)
                ended = missing_s > kept_s and track.missed > 0
            else:
                kept_s = self.keep_lost_s
                if track.missed > life.tentative_runs:
                    kept_s = min(kept_s, max(life.brief_s, state.seen_s - state.born_s))
                ended = missing_s > kept_s and track.missed > 0
            if missing_s > 0:
                state.slow_down(math.exp(-self._dt_s / life.hidden_s))
            if not ended:
                kept.append(track)
        self.tracks = kept
        self._places.append((self._now_s, self._centers()))
        while self._places and self._places[0][0] < self._now_s - REMEMBERED_S:
            self._places.popleft()
        return [self._track(each) for each in kept]

    def _associate(
        self,
        found: Sequence[ScoredBox],
        tracks: Sequence[BoxTrack],
        moved: Mapping[int, Center],
    ) -> None:
        tracks = list(tracks)  # new ones are not among them
        expected = [self._expected(each, moved) for each in tracks]
        matches = match_boxes(expected, found, self._limits)
        for track in tracks:
            track.missed += 1
        for row, column in matches.pairs:
            track = tracks[row]
            self._measure(track, found[column], moved.get(track.state.id, (0.0, 0.0)))
        for column in matches.new[: max(0, MAX_TRACKS - len(self.tracks))]:
            self._begin(found[column])

    def _centers(self) -> dict[int, Center]:
        return {
            each.state.id: (each.state.x.position, each.state.y.position) for each in self.tracks
        }

    def _expected(self, track: BoxTrack, moved: Mapping[int, Center]) -> Expected:
        state = track.state
        dx, dy = moved.get(state.id, (0.0, 0.0))
        box = state.box
        area = state.width * state.height
        return Expected(
            Region(box.left - dx, box.top - dy, box.right - dx, box.bottom - dy, area),
            (math.sqrt(state.x.pp), math.sqrt(state.y.pp)),
            state.confirmed,
            state.missing_s(self._now_s),
            track.name,
        )

    def _measure(self, track: BoxTrack, found: ScoredBox, moved: Center) -> None:
        state, region = track.state, found.region
        share = max(1 - math.exp(-self._dt_s / self._life.size_s), 1 / (track.found + 1))
        ratios = (region.width / max(1e-6, state.width), region.height / max(1e-6, state.height))
        differs = max(abs(math.log(max(1e-6, ratio))) for ratio in ratios)
        share = min(1.0, max(share, (differs - self._life.noise) / self._life.change))
        state.resize(region.width, region.height, region.area, share)
        (x, y), (dx, dy) = region.center, moved
        track.place = x + dx, y + dy
        state.correct(track.place, self._now_s)
        track.found += self._hits(found)
        track.missed, track.score = 0, found.score
        for name in track.evidence:
            track.evidence[name] *= self._life.fading  # type: ignore[assignment]
        track.evidence[found.name] += found.score  # type: ignore[assignment]

    def _begin(self, found: ScoredBox) -> None:
        state = new_state(self.next_id, found.region, self._now_s)
        self.next_id += 1
        evidence: Counter[str] = Counter()
        evidence[found.name] = found.score  # type: ignore[assignment]
        track = BoxTrack(state, self._hits(found), 0, evidence, found.score)
        track.place = found.region.center
        self.tracks.append(track)

    def _hits(self, found: ScoredBox) -> float:
        if found.score < found.least:
            return 0.0
        life = self._life
        is_clear = found.score - found.least >= life.clear * (1 - found.least)
        return life.clear_hits if is_clear else 1.0

    def _alike(self, one: Region | None, other: Region | None) -> bool:
        if one is None or other is None:
            return False
        ratios = one.width / max(1e-6, other.width), one.height / max(1e-6, other.height)
        return all(1 / self._life.alike < ratio < self._life.alike for ratio in ratios)

    def _shift(self, track: BoxTrack, before: Region | None, now: Region | None) -> None:
        """Move a track as its region of motion has moved since the last frame."""
        assert before is not None
        assert now is not None
        (x, y), (x1, y1), (x0, y0) = track.place, now.center, before.center
        track.place = x + x1 - x0, y + y1 - y0
        track.state.correct(track.place, self._now_s)

    def _outside(self, state: TrackState) -> bool:
        width, height = self._size
        return not (0 < state.x.position < width and 0 < state.y.position < height)

    def _leaving(self, state: TrackState) -> bool:
        """Return whether an object is expected at the border of the picture, or outside of it."""
        (width, height), box = self._size, state.box
        return self._outside(state) or (
            box.left <= 1 or box.top <= 1 or box.right >= width - 1 or box.bottom >= height - 1
        )

    def _state_name(self, state: TrackState) -> Literal["tentative", "confirmed", "lost"]:
        if not state.confirmed:
            return "tentative"
        limit_s = self._life.leaving_s if self._leaving(state) else self._life.shown_s
        if self._outside(state):
            limit_s = 0.0
        limit_s = min(limit_s, self._life.proven * (state.seen_s - state.born_s))
        return "confirmed" if state.missing_s(self._now_s) <= limit_s else "lost"

    def _track(self, track: BoxTrack) -> Track:
        state = track.state
        box = state.box
        return Track(
            id=state.id,
            state=self._state_name(state),
            x=state.x.position,
            y=state.y.position,
            box=(
                round(box.left),
                round(box.top),
                max(1, round(box.width)),
                max(1, round(box.height)),
            ),
            area=box.width * box.height,
            vx=state.x.velocity,
            vy=state.y.velocity,
            age_s=max(0.0, self._now_s - state.born_s),
            missing_s=state.missing_s(self._now_s),
            steady=state.steady,
            class_name=track.name,
            score=track.score,
        )
