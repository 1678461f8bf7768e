"""Tracks all objects of one camera from frame to frame, each under an id."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from zv.tracker.tracking import association
from zv.tracker.tracking.appearance import Scene
from zv.tracker.tracking.fragment import Fragment, union
from zv.tracker.tracking.matching import OVERLAP, Matcher
from zv.tracker.tracking.target import SHOWN_S, Target
from zv.tracker.tracking.targets import Targets
from zv.tracker.tracking.track import Track

MAX_FRAGMENTS = 400
"""Further fragments are ignored, the smallest first, so that the time for a frame is bounded."""

MAX_STEP_S = 60.0
"""Positions are predicted for at most this time, even if the clock was set forward by more: a
larger variance would exhaust the precision of floating-point numbers."""

SMOOTHED = 0.1
"""A track's position is the smoothed centre if that is within this distance, in sides, of the
centre of its box."""

LEAVING_SHOWN_S = 0.1
"""A track that is expected at the border is lost if not seen for longer than this; one that is
expected outside, in the first frame that does not show it."""

TENTATIVE_S = 0.3
PROTECTED_SIDES = 1.2
"""An object that has moved farther than this is kept out of the background even if it stands."""

SETTLED_SIDES = 3.0
"""An object that has moved steadily for more than this is confirmed even where pixels keep
changing: in a lane with much traffic, the objects themselves change the pixels."""

STEADY_SIDES = 0.1
"""A motion is steady if the last places are within this distance, root mean square, of a motion
with constant velocity. Leaves jump by 0.1 to 0.6 of their side."""

SEEN_SHARE = 0.8
"""A track that was seen for a smaller share of its age follows something that flickers, and is not
confirmed before it has moved by ``SETTLED_SIDES``. The share does not depend on the frame rate."""


@dataclass(frozen=True, slots=True)
class TrackingParameters:
    """The parameters of ``Tracker``."""

    confirm_s: float = 0.4  # age at which a track may be confirmed
    confirm_hits: int = 3  # frames in which it must have been seen
    confirm_sides: float = 0.4  # how far it must have moved, in sides of its box
    keep_lost_s: float = 2.0  # how long a track that is not seen is kept
    min_area: float = 40.0  # of the foreground of a new object, square pixels of the mask
    protect_s: float = 120.0  # how long an object that stopped is kept out of the background
    convex: bool = False  # each fragment is an object, none a part of one


class Tracker:
    """Turns the fragments of successive frames into tracks.

    All times are in seconds of the frames' stamps, and all limits of lengths in sides of the
    objects, so that they hold at any frame rate and resolution. If a stamp is not later than the
    previous one, no time passes: positions are measured, but nothing ages.

    Args:
        parameters: The limits.
        size: Width and height of the mask.
        scale: Full-resolution pixels per pixel of the mask.
        first_id: Id of the first track; each further one gets the next number.
    """

    def __init__(
        self,
        parameters: TrackingParameters,
        size: tuple[int, int],
        scale: float = 1.0,
        first_id: int = 1,
    ) -> None:
        self.parameters = parameters
        self._targets = Targets(size, first_id)
        self._scale = scale

    @property
    def targets(self) -> list[Target]:
        """The state of each track, oldest first."""
        return self._targets.all

    @property
    def next_id(self) -> int:
        """The id that the next new track gets."""
        return self._targets.next_id

    @property
    def now_ns(self) -> int:
        """Time by which the stamps have advanced since the first frame; it never goes back."""
        return self._targets.now_ns

    def update(
        self, fragments: Sequence[Fragment], stamp_ns: int, scene: Scene | None = None
    ) -> list[Track]:
        """Process the fragments of one frame; return the tracks at its stamp, oldest first.

        Args:
            fragments: The connected regions of the frame's foreground.
            stamp_ns: Capture time of the frame.
            scene: Pixels of the frame; without them, objects that meet are distinguished by their
                motion alone.
        """
        dt_s = self._targets.pass_time(stamp_ns)
        fragments = sorted(fragments, key=lambda each: (-each.area, each.left, each.top))
        fragments = fragments[:MAX_FRAGMENTS]
        for target in self.targets:
            target.predict(min(dt_s, MAX_STEP_S))
        free = Matcher(self._targets, fragments, dt_s, scene, convex=self.parameters.convex).match()
        self._begin(free, scene)
        self._confirm_and_end(dt_s, scene)
        return self.tracks()

    def tracks(self) -> list[Track]:
        """Return the tracks at the stamp of the last frame, in full-resolution pixels."""
        return [self._track(target) for target in self.targets]

    def protected(self) -> list[Fragment]:
        """Return the boxes of objects that must not become background, even if they stand."""
        limit_ns = self.parameters.protect_s * 1e9
        return [
            target.box
            for target in self.targets
            if target.travelled > PROTECTED_SIDES
            and self.now_ns - target.moved_ns < limit_ns
            and target.missing_s(self.now_ns) < SHOWN_S
        ]

    def _track(self, target: Target) -> Track:
        scale, box = self._scale, target.shown or target.box
        missing_s = target.missing_s(self.now_ns)
        width, height = max(1, round(box.width * scale)), max(1, round(box.height * scale))
        x, y = target.x.position, target.y.position
        if math.dist((x, y), box.center) > SMOOTHED * target.side:
            x, y = box.center
        return Track(
            id=target.id,
            state=(
                "tentative"
                if not target.confirmed
                else "confirmed"
                if missing_s <= self._shown_s(target)
                else "lost"
            ),
            x=x * scale,
            y=y * scale,
            box=(round(box.left * scale), round(box.top * scale), width, height),
            area=max(0.0, target.area) * scale * scale,
            vx=target.x.velocity * scale,
            vy=target.y.velocity * scale,
            age_s=max(0.0, (self.now_ns - target.born_ns) / 1e9),
            missing_s=missing_s,
            steady=target.steady and (target.steady[0] * scale, target.steady[1] * scale),
            offset=(target.offset[0] * scale, target.offset[1] * scale),
        )

    def _begin(self, free: list[Fragment], scene: Scene | None) -> None:
        """Begin tracks for unmatched fragments; parts of one object are joined."""
        known = [target.box for target in self.targets]
        for found in free if self.parameters.convex else _joined(free):
            if found.area < self.parameters.min_area:
                continue
            if any(association.overlap(found, box) > OVERLAP for box in known):
                continue
            target = self._targets.begin(found)
            if target is not None and scene is not None:
                target.appearance.learn(scene, target.box, 1.0)

    def _confirm_and_end(self, dt_s: float, scene: Scene | None) -> None:
        wanted, now_ns = self.parameters, self.now_ns
        kept = []
        for target in self.targets:
            if not target.confirmed:
                target.remember(now_ns, dt_s)
                if self._is_object(target, scene):
                    target.confirmed, target.path = True, []
            missing_s = target.missing_s(now_ns)
            if not target.confirmed:
                ended = missing_s > TENTATIVE_S
            elif self._targets.leaving(target):
                ended = missing_s > SHOWN_S
            else:
                ended = missing_s > wanted.keep_lost_s
            if not ended:
                kept.append(target)
        self._targets.all = kept

    def _is_object(self, target: Target, scene: Scene | None) -> bool:
        """Return whether a track has been seen and has moved as an object does."""
        wanted, now_ns = self.parameters, self.now_ns
        age_s = (now_ns - target.born_ns) / 1e9
        return (
            target.seen_ns == now_ns  # something that flickers is lost where it was expected
            and age_s >= wanted.confirm_s
            and target.hits >= wanted.confirm_hits
            and target.travelled >= wanted.confirm_sides
            and (
                (target.travelled > SETTLED_SIDES and target.unsteadiness() <= STEADY_SIDES)
                or (
                    target.seen_s >= SEEN_SHARE * age_s
                    and (scene is None or scene.is_settled(target.shown or target.box))
                )
            )
        )

    def _shown_s(self, target: Target) -> float:
        """Return for how long a track that is not seen stays confirmed."""
        if self._targets.outside(target):
            return 0.0
        return LEAVING_SHOWN_S if self._targets.leaving(target) else SHOWN_S


def _joined(free: list[Fragment]) -> list[Fragment]:
    """Join fragments with those above and below that seem to belong to the same object."""
    found: list[Fragment] = []
    for fragment in free:  # the largest first
        for number, other in enumerate(found):
            shared = min(fragment.right, other.right) - max(fragment.left, other.left)
            gap = max(fragment.top, other.top) - min(fragment.bottom, other.bottom)
            narrow = min(fragment.width, other.width)
            if shared > 0.5 * narrow and gap < 0.4 * max(other.width, fragment.width):
                found[number] = union([other, fragment])
                break
        else:
            found.append(fragment)
    return found
