"""Tracks all objects of one camera from frame to frame, each under an id."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

from zv.tracker.tracking import boxes
from zv.tracker.tracking.appearance import Scene, learned
from zv.tracker.tracking.association import (
    AssociationLimits,
    Begin,
    Decision,
    End,
    Follow,
    Share,
    associate,
)
from zv.tracker.tracking.base import TrackerBase
from zv.tracker.tracking.groups import divide
from zv.tracker.tracking.measuring import measure, measure_portion
from zv.tracker.tracking.region import Region
from zv.tracker.tracking.state import TrackState
from zv.tracker.tracking.track import Track


@dataclass(frozen=True, slots=True)
class LifeLimits:
    """The constants of a track's life; seconds of stamps."""

    confirm_s: float = 0.3  # age at which a track may be confirmed
    # Share of that age for which it must have been seen: other things flicker.
    seen_share: float = 0.8
    confirm_sides: float = 1.0  # how far it must have moved, in smaller sides of its box
    rest_s: float = 2.0  # it must move so far within one motion: what stands for longer begins anew
    # A track that was never confirmed, or is at the border of the picture, ends if it is not seen
    # for longer than this.
    gone_s: float = 0.3
    # An object that has travelled farther is not learned while it stands,
    protected_sides: float = 1.0
    protect_s: float = 120.0  # for this long;
    # if it did not come in over the border of where objects are detected, for this long for each
    # side that it has travelled after the last change in its box: a door and a balloon move, and
    # stand without one.
    unchanged_s: float = 2.0
    # What has stood for this long may be a ghost, and is tested in this interval.
    still_s: float = 1.0


@dataclass(frozen=True, slots=True)
class TrackingParameters:
    """The parameters of ``Tracker``."""

    keep_lost_s: float = 2.0  # how long a track that is not seen is kept
    min_area: float = 40.0  # of what begins, is confirmed, or seen then; square pixels of the mask
    convex: bool = False  # each region is an object, none a part of one
    life: LifeLimits = field(default_factory=LifeLimits)
    association: AssociationLimits = field(default_factory=AssociationLimits)


class Tracker(TrackerBase[TrackState]):
    """Turns the regions of successive frames into tracks; see ``TrackerBase``.

    All limits of times are in seconds, and those of lengths in sides of the objects, so that they
    hold at any frame rate and resolution.
    """

    def __init__(
        self,
        parameters: TrackingParameters,
        size: tuple[int, int],
        scale: float = 1.0,
        first_id: int = 1,
    ) -> None:
        super().__init__(TrackState, size, scale, first_id)
        self.parameters = parameters

    def update(self, regions: Sequence[Region], scene: Scene) -> list[Track]:
        """Process the regions of the frame to which the tracks were predicted.

        Args:
            regions: The connected regions of the frame's foreground.
            scene: Pixels of the frame, to distinguish objects that meet.

        Returns:
            The tracks, oldest first, in full-resolution pixels.
        """
        wanted = self.parameters
        for decision in associate(self.states, regions, wanted.association, convex=wanted.convex):
            self._apply(decision, scene)
        self._confirm_and_end()
        return [self._track(state) for state in self.states]

    def protected(self) -> list[Region]:
        """Return the boxes of objects that must not become background, even if they stand."""
        life, now_s = self.parameters.life, self._moment.now_s
        return [
            state.box
            for state in self.states
            if state.confirmed
            and state.travelled > life.protected_sides
            and now_s - state.stands_s < life.protect_s
        ]

    def is_unchanged(self, state: TrackState) -> bool:
        """Return whether what travelled within the picture stands for long without any change."""
        life = self.parameters.life
        unchanged_s = self._moment.now_s - max(state.stands_s, state.changed_s)
        return (
            not state.came_in
            and state.travelled > life.protected_sides
            and unchanged_s > life.unchanged_s * state.travelled
        )

    def suspects(self) -> list[TrackState]:
        """Return the tracks that may be ghosts, since they stand; each is due once in a while."""
        life, now_s = self.parameters.life, self._moment.now_s
        found = [
            state
            for state in self.states
            if state.seen_s == now_s and now_s - max(state.stands_s, state.tested_s) >= life.still_s
        ]
        for state in found:
            state.tested_s = now_s
        return found

    def _apply(self, decision: Decision, scene: Scene) -> None:
        moment = self._moment
        match decision:
            case Follow(track, region):
                track.grouped = track.grouped and self._near_another(track)
                seen_s = track.seen_s
                measure(track, region, moment, scene)
                if track.confirmed and region.area < self.parameters.min_area:
                    track.seen_s = seen_s  # a part of it moves it, but shows not where it is
            case Share(tracks, regions):
                self._share(tracks, regions, scene)
            case End(track):
                self.drop(track)
            case Begin(region):
                least, overlap = self.parameters.min_area, self.parameters.association.overlap
                known = [each.shown or each.box for each in self.states]
                if region.area >= least and (boxes.overlaps([region], known) <= overlap).all():
                    self._begin(region, scene)

    def _begin(self, region: Region, scene: Scene) -> None:
        state = self._new(region)
        if state is not None:
            state.colors = learned(None, scene, state.box, 1.0)

    def _share(self, tracks: Sequence[TrackState], regions: Sequence[Region], scene: Scene) -> None:
        moment = self._moment
        doubt_s = self.parameters.association.doubt * moment.dt_s
        for track, portion in zip(tracks, divide(tracks, regions, scene), strict=True):
            track.grouped = True
            track.alone_s = max(0.0, track.alone_s - doubt_s)
            measure_portion(track, portion, moment, self.parameters.min_area)

    def _near_another(self, track: TrackState) -> bool:
        """Return whether another object, possibly hidden, is expected in the track's box."""
        others = [each.box for each in self.states if each is not track]
        return bool(boxes.overlaps([track.box], others).any())

    def _confirm_and_end(self) -> None:
        life, now_s = self.parameters.life, self._moment.now_s
        kept = []
        for state in self.states:
            if state.seen_s == now_s and state.born_s < now_s:
                state.shown_s += self._moment.dt_s
            if not state.confirmed and now_s - state.stands_s > life.rest_s:
                state.rest()
            state.confirmed |= (
                state.seen_s == now_s
                and state.shown_s >= life.seen_share * (now_s - state.born_s) - 1e-6
                and now_s - state.born_s >= life.confirm_s
                and state.travelled >= life.confirm_sides
                and state.area >= self.parameters.min_area
            )
            stays = state.confirmed and not self._moment.at_border(state.box)
            if state.missing_s(now_s) <= (self.parameters.keep_lost_s if stays else life.gone_s):
                kept.append(state)
        self.states = kept
