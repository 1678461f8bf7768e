"""Follows all objects of one camera from frame to frame, with an id for each."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from zv.tracker.tracking import association
from zv.tracker.tracking.appearance import Scene
from zv.tracker.tracking.fragment import Fragment, union
from zv.tracker.tracking.groups import place
from zv.tracker.tracking.target import SIZE_TIME_S, Target, new_target
from zv.tracker.tracking.track import Track

MAX_FRAGMENTS = 400
MAX_TARGETS = 400
"""More of either are left out, the smallest first, so that the time for a frame has a bound."""

MOST_STEP_S = 60.0
"""Positions are not predicted over longer steps, such as those of a clock that is set: their
variance would leave no digit for the rest of the arithmetic."""

OVERLAP = 0.4
DUPLICATE_SHARE = 0.8
GROWN = 1.25
"""A box that differs by this factor from what is known is measured by its better edge."""

PLAUSIBLE = 1.7
"""Foreground that differs from an object's usual area by at most this factor is all of it: then its
own box is the track's, whatever the size that the object had in other poses."""

SMOOTHED = 0.1
"""The smoothed middle is a track's place if it is so near to the middle of its box, in sides."""

PARTED_S = 0.4
SHOWN_S = 0.3
"""A confirmed track that is not seen for so long is lost."""

TENTATIVE_S = 0.3
UNMOVED_S = 5.0
SAME_S = 1.0
LOOKS_TIME_S = 1.0
LEARN_EVERY_S = 0.15
POOR_FIT = 0.7
OTHER_LOOKS = 0.75
HIDDEN_STOP_S = 0.5
GATE_SIDES = 0.7
GROUP_MEMORY_NS = 1_500_000_000


@dataclass(frozen=True, slots=True)
class TrackingParameters:
    """The parameters of ``Tracker``."""

    confirm_s: float = 0.4  # age at which a track may be confirmed
    confirm_hits: int = 3  # frames in which it must have been seen
    confirm_sides: float = 0.4  # how far it must have moved, in sides of its box
    keep_lost_s: float = 2.0  # how long a track that is not seen is kept
    min_area: float = 40.0  # of the foreground of a new object, square pixels of the mask
    protect_s: float = 120.0  # how long an object that stopped is kept out of the background


class Tracker:
    """Tracks of the objects that a sequence of fragments shows.

    All times are in seconds of the frames' stamps, and all limits of lengths in sides of the
    objects, so neither the frame rate nor the resolution changes the result. With a stamp that is
    the same as the last one or before it, no time passes: positions are measured, nothing ages.

    Args:
        parameters: See there.
        size: Width and height of the mask.
        scale: Full-resolution pixels per pixel of the mask.
        first_id: Of the first track; each further one gets the next number.
    """

    def __init__(
        self,
        parameters: TrackingParameters,
        size: tuple[int, int],
        scale: float = 1.0,
        first_id: int = 1,
    ) -> None:
        self.parameters = parameters
        self.next_id = first_id
        self.targets: list[Target] = []
        self._size = size
        self._scale = scale
        self._stamp_ns: int | None = None
        self.now_ns = 0

    # Results

    def update(
        self, fragments: Sequence[Fragment], stamp_ns: int, scene: Scene | None = None
    ) -> list[Track]:
        """Take the fragments of one frame, and return the tracks at its stamp, oldest first.

        Args:
            fragments: The regions of its foreground.
            stamp_ns: Its capture time.
            scene: Its pixels; without them, objects that meet are told apart by motion alone.
        """
        dt_s = self._pass_time(stamp_ns)
        fragments = sorted(fragments, key=lambda each: (-each.area, each.left, each.top))
        fragments = fragments[:MAX_FRAGMENTS]
        for target in self.targets:
            target.shown = None
            target.predict(min(dt_s, MOST_STEP_S))
        free = self._associate(fragments, dt_s, scene)
        self._begin([fragments[number] for number in free], scene)
        self._confirm_and_end()
        return self.tracks()

    def tracks(self) -> list[Track]:
        """Return the tracks at the stamp of the last frame, in full-resolution pixels."""
        return [self._track(target) for target in self.targets]

    def predict(
        self, number: int, stamp_ns: int
    ) -> tuple[float, float, float, float, float, float]:
        """Return where a track will be, in full-resolution pixels.

        Args:
            number: Its id.
            stamp_ns: When; a time before the last frame counts as that.

        Returns:
            x, y of its middle; their standard deviations; vx, vy in pixels per second.

        Raises:
            KeyError: There is no track with this id now.
        """
        target = next((each for each in self.targets if each.id == number), None)
        if target is None:
            raise KeyError(number)
        dt_s = max(0, stamp_ns - (self._stamp_ns or 0)) / 1e9
        axes = target.x.copy(), target.y.copy()
        for axis in axes:
            axis.predict(dt_s, 1.5 * target.side)
        x, y = (self._scale * axis.position for axis in axes)
        sigma_x, sigma_y = (self._scale * math.sqrt(max(0.0, axis.pp)) for axis in axes)
        vx, vy = (self._scale * axis.velocity for axis in axes)
        return x, y, sigma_x, sigma_y, vx, vy

    def protected(self) -> list[Fragment]:
        """Return the boxes of objects that must not become background, though they may stand."""
        limit_ns = self.parameters.protect_s * 1e9
        return [
            target.box
            for target in self.targets
            if target.travelled > 1.2
            and self.now_ns - target.moved_ns < limit_ns
            and target.missing_s(self.now_ns) < SHOWN_S
        ]

    def drop(self, number: int) -> None:
        """End a track, such as one of a ghost."""
        self.targets = [each for each in self.targets if each.id != number]

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
                if missing_s <= SHOWN_S
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
        )

    # Time

    def _pass_time(self, stamp_ns: int) -> float:
        """Return the seconds since the last frame; after a step back, count on from there.

        Ages are counted on a clock of the tracker's own, which such a step does not set back.
        """
        step_ns = 0 if self._stamp_ns is None else max(0, stamp_ns - self._stamp_ns)
        self._stamp_ns = stamp_ns
        self.now_ns += step_ns
        return step_ns / 1e9

    # Association

    def _associate(self, fragments: list[Fragment], dt_s: float, scene: Scene | None) -> list[int]:
        """Correct the targets by the fragments; return the numbers of those that belong to none."""
        targets = self.targets
        if not targets or not fragments:
            return list(range(len(fragments)))
        boxes = [target.box for target in targets]
        links = association.overlaps(boxes, fragments) > OVERLAP
        for row, target in enumerate(targets):
            if target.missing_s(self.now_ns) - dt_s > SHOWN_S and target.grouped_ns is None:
                links[row] = False
        self._link_the_rest(fragments, links, scene)
        for rows, columns in association.components(links):
            owned = [fragments[column] for column in columns]
            members = [targets[row] for row in rows]
            if len(members) == 1:
                self._follow_one(members[0], owned, dt_s, scene)
            else:
                self._follow_several(members, owned, dt_s, scene)
        return np.flatnonzero(~links.any(axis=0)).tolist()

    def _link_the_rest(
        self, fragments: list[Fragment], links: NDArray[np.bool_], scene: Scene | None
    ) -> None:
        """Link targets and fragments that have no link yet, by the least sum of distances."""
        rows = np.flatnonzero(~links.any(axis=1))
        columns = np.flatnonzero(~links.any(axis=0))
        if not rows.size or not columns.size:
            return
        costs = np.full((rows.size, columns.size), association.IMPOSSIBLE)
        centers = np.array([fragments[column].center for column in columns])
        areas = np.array([fragments[column].area for column in columns])
        for number, row in enumerate(rows):
            target = self.targets[row]
            deviations = [
                math.sqrt(axis.pp) + GATE_SIDES / 2 * target.side for axis in (target.x, target.y)
            ]
            away = np.square((centers[:, 0] - target.x.position) / deviations[0])
            away += np.square((centers[:, 1] - target.y.position) / deviations[1])
            ratio = np.abs(np.log((areas + 1) / (target.area + 1)))
            fits = (away < 4.0) & (ratio < 1.2)
            costs[number, fits] = (away + ratio)[fits]
            if scene is None or target.missing_s(self.now_ns) < SHOWN_S:
                continue
            for column in np.flatnonzero(fits):
                looks = target.appearance.distance(scene, fragments[columns[column]])
                costs[number, column] += 3 * looks
                if looks > OTHER_LOOKS:
                    costs[number, column] = association.IMPOSSIBLE
        for number, place_ in association.assigned(costs):
            links[rows[number], columns[place_]] = True

    def _follow_one(
        self, target: Target, owned: list[Fragment], dt_s: float, scene: Scene | None
    ) -> None:
        whole = union(owned)
        parts = _parts(target, owned)
        if parts is None:
            target.parted_ns = None
        elif target.parted_ns is None:
            target.parted_ns = self.now_ns
        elif (self.now_ns - target.parted_ns) / 1e9 >= PARTED_S:
            self._split(target, parts, scene)
            return
        target.grouped_ns = None if self._long_alone(target) else target.grouped_ns
        self._measure(target, whole, dt_s, scene, learn=parts is None)

    def _long_alone(self, target: Target) -> bool:
        return target.grouped_ns is None or self.now_ns - target.grouped_ns > GROUP_MEMORY_NS

    def _follow_several(
        self, members: list[Target], owned: list[Fragment], dt_s: float, scene: Scene | None
    ) -> None:
        """Correct targets that claim the same fragments."""
        pairs = _one_for_each(members, owned, scene)
        if pairs is not None:
            taken = {number for _, number in pairs}
            for row, number in pairs:
                target = members[row]
                mine = [owned[number]]
                for other in range(len(owned)):
                    if other not in taken and _nearest(members, owned[other]) is target:
                        mine.append(owned[other])
                self._measure(target, union(mine), dt_s, scene, learn=True)
            return
        ids = frozenset(target.id for target in members)
        if scene is None:
            placed = [((each.x.position, each.y.position), 1.0) for each in members]
        else:
            placed = place(members, scene)
        for target, (middle, cost) in zip(members, placed, strict=True):
            target.group = ids
            target.grouped_ns = self.now_ns
            target.parted_ns = None
            if cost < POOR_FIT:
                target.correct(middle, self.now_ns, 1.0 + 2 * max(0.0, cost))
            else:  # hidden behind the others
                target.slow_down(math.exp(-dt_s / HIDDEN_STOP_S))
        self._drop_duplicates(members, union(owned))

    def _drop_duplicates(self, members: list[Target], whole: Fragment) -> None:
        """End the newer of two tracks that share the box of one object."""
        ordered = sorted(members, key=lambda each: each.id)
        boxes = [each.box for each in ordered]
        shared = np.triu(association.overlaps(boxes, boxes) > DUPLICATE_SHARE, 1)
        for first, second in np.argwhere(shared):
            one, two = ordered[first], ordered[second]
            if whole.area >= 1.2 * max(one.area, two.area):
                continue
            if not two.confirmed or two.parted_ns is not None:
                self.drop(two.id)

    def _measure(
        self, target: Target, found: Fragment, dt_s: float, scene: Scene | None, *, learn: bool
    ) -> None:
        """Correct a target by the box of its own foreground."""
        expected = target.box
        share = 1 - math.exp(-dt_s / SIZE_TIME_S) if dt_s > 0 else 0.0
        share = max(share, 1 / (target.hits + 1))
        x, width = _along(
            found.left, found.right, expected.left, expected.right, self._size[0], target.full
        )
        y, height = _along(
            found.top, found.bottom, expected.top, expected.bottom, self._size[1], target.full
        )
        complete = width and height
        if not self._at_border(found):
            target.full = True
        target.resize(
            found.width if width or not target.full else target.width,
            found.height if height or not target.full else target.height,
            found.area if complete else target.area,
            1.0 if not target.full else share if complete else share / 4,
        )
        if not target.full:
            x, y = found.center
        if 1 / PLAUSIBLE < found.area / max(1.0, target.area) < PLAUSIBLE:
            target.shown = found
        before = target.travelled
        target.correct((x, y), self.now_ns)
        speed = math.hypot(target.x.velocity, target.y.velocity) / target.side
        if speed > 0.2 or target.travelled > before:
            target.moved_ns = self.now_ns
        since_s = (self.now_ns - target.learned_ns) / 1e9
        if scene is not None and learn and complete and since_s >= LEARN_EVERY_S:
            share = 1 - math.exp(-min(since_s, LOOKS_TIME_S) / LOOKS_TIME_S)
            target.appearance.learn(scene, target.box, share)
            target.learned_ns = self.now_ns

    def _split(self, target: Target, parts: tuple[Fragment, Fragment], scene: Scene | None) -> None:
        """Make one target two: the part that is more like it keeps its id."""
        costs = []
        for part in parts:
            x, y = part.center
            away = math.hypot(x - target.x.position, y - target.y.position) / target.side
            looks = 0.5 if scene is None else target.appearance.distance(scene, part)
            costs.append(away + looks)
        mine, other = parts if costs[0] <= costs[1] else parts[::-1]
        target.parted_ns = None
        target.resize(mine.width, mine.height, mine.area, 1.0)
        target.appearance = type(target.appearance)()
        target.correct(mine.center, self.now_ns)
        if scene is not None:
            target.appearance.learn(scene, target.box, 1.0)
        if len(self.targets) >= MAX_TARGETS:
            return
        split = self._new(other)
        split.x.velocity, split.y.velocity = target.x.velocity, target.y.velocity
        split.confirmed = target.confirmed
        split.travelled = target.travelled
        split.full = target.full
        if scene is not None:
            split.appearance.learn(scene, split.box, 1.0)

    # Life

    def _new(self, fragment: Fragment) -> Target:
        target = new_target(self.next_id, fragment, self.now_ns)
        self.next_id += 1
        self.targets.append(target)
        target.full = not self._at_border(fragment)
        target.cut = not target.full
        return target

    def _begin(self, free: list[Fragment], scene: Scene | None) -> None:
        """Begin tracks for fragments that belong to none; parts of one object are joined."""
        known = [target.box for target in self.targets]
        for found in _joined(free):
            if found.area < self.parameters.min_area or len(self.targets) >= MAX_TARGETS:
                continue
            if known and association.overlaps([found], known).max() > OVERLAP:
                continue
            target = self._new(found)
            if scene is not None:
                target.appearance.learn(scene, target.box, 1.0)

    def _confirm_and_end(self) -> None:
        wanted, now_ns = self.parameters, self.now_ns
        kept = []
        for target in self.targets:
            age_s = (now_ns - target.born_ns) / 1e9
            if (
                age_s >= wanted.confirm_s
                and target.hits >= wanted.confirm_hits
                and target.travelled >= wanted.confirm_sides
            ):
                target.confirmed = True
            missing_s = target.missing_s(now_ns)
            if not target.confirmed:
                ended = missing_s > TENTATIVE_S
            elif self._leaving(target):
                ended = missing_s > SHOWN_S
            else:
                ended = missing_s > wanted.keep_lost_s
            if not ended:
                kept.append(target)
        self.targets = kept

    def _at_border(self, box: Fragment) -> bool:
        width, height = self._size
        return box.left <= 1 or box.top <= 1 or box.right >= width - 1 or box.bottom >= height - 1

    def _leaving(self, target: Target) -> bool:
        """Whether it is expected to be outside of the picture, at least half of it."""
        width, height = self._size
        x, y = target.x.position, target.y.position
        return not (0 < x < width and 0 < y < height) or self._at_border(target.box)


def _along(
    low: float, high: float, expected_low: float, expected_high: float, end: int, full: bool
) -> tuple[float, bool]:
    """Return the middle of a box along one axis, and whether its length there can be believed.

    If the length is not the expected one, as only a part is seen or something else is there too,
    the edge that is nearer to the expected one is believed.
    """
    length, expected = high - low, max(1e-6, expected_high - expected_low)
    cut_low, cut_high = low <= 1, high >= end - 1
    if cut_low and not cut_high:
        return high - expected / 2, False
    if cut_high and not cut_low:
        return low + expected / 2, False
    if not full or 1 / GROWN < length / expected < GROWN:
        return (low + high) / 2, True
    if abs(low - expected_low) < abs(high - expected_high):
        return low + expected / 2, False
    return high - expected / 2, False


def _parts(target: Target, owned: list[Fragment]) -> tuple[Fragment, Fragment] | None:
    """Return two halves, left and right, if the fragments of a target look like two objects."""
    ordered = sorted(owned, key=lambda each: each.center[0])
    for number in range(1, len(ordered)):
        one, two = union(ordered[:number]), union(ordered[number:])
        if one.right > two.left + 1:
            continue
        heights = sorted((one.height, two.height))
        areas = sorted((one.area, two.area))
        if (
            heights[0] > 0.6 * heights[1]
            and areas[0] > 0.3 * areas[1]
            and (heights[0] > 0.55 * target.height)
        ):
            return one, two
    return None


def _one_for_each(
    members: list[Target], owned: list[Fragment], scene: Scene | None
) -> list[tuple[int, int]] | None:
    """Return a fragment for each target, if there are as many that could be an object."""
    if len(owned) < len(members):
        return None
    costs = np.full((len(members), len(owned)), association.IMPOSSIBLE)
    for row, target in enumerate(members):
        for column, fragment in enumerate(owned):
            if not (
                fragment.height > 0.6 * target.height
                and 0.4 * target.area < fragment.area < 1.7 * target.area
                and fragment.width < 1.6 * target.width
            ):
                continue
            x, y = fragment.center
            away = math.hypot(x - target.x.position, y - target.y.position) / target.side
            looks = 0.0
            if scene is not None and target.grouped_ns is not None:
                looks = 2.0 * target.appearance.distance(scene, fragment)
            if away < 1.5:
                costs[row, column] = away + looks
    pairs = association.assigned(costs)
    return pairs if len(pairs) == len(members) else None


def _nearest(members: list[Target], fragment: Fragment) -> Target:
    x, y = fragment.center
    return min(
        members,
        key=lambda each: (
            abs(x - each.x.position) / each.width + abs(y - each.y.position) / each.height,
            each.id,
        ),
    )


def _joined(free: list[Fragment]) -> list[Fragment]:
    """Return fragments joined with those above and below them that seem to be the same object."""
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
