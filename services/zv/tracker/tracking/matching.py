"""Associates the fragments of the foreground with objects, and corrects the objects' states."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from zv.tracker.tracking import association, merging
from zv.tracker.tracking.appearance import Appearance, Scene
from zv.tracker.tracking.fragment import Fragment, union
from zv.tracker.tracking.groups import divide
from zv.tracker.tracking.measuring import PLAUSIBLE, measure, measure_portion
from zv.tracker.tracking.merging import PROVEN_S
from zv.tracker.tracking.searching import found_in
from zv.tracker.tracking.target import SHOWN_S, Target
from zv.tracker.tracking.targets import Targets

OVERLAP = 0.4
"""A fragment may belong to an object if its intersection with the object's expected box is more
than this share of the smaller of the two."""

GATE_SIDES = 0.7
OTHER_APPEARANCE = 0.75
"""A fragment whose appearance differs more than this from a missing object is another object."""

TURNING_SPEED = 8.0
"""Speed, in sides per second, at which an object such as a ball may have moved in any direction
since the last frame. A faster object may have moved in any direction at its own speed."""

LEAST_FOUND = 0.2
"""An object is found in the region of others if at least this share of it has colours that are
clearly its own; other objects may hide the rest, or have similar colours."""

LEAST_MORE = 0.25
"""That region must be larger than the other objects by at least this share of the object."""

HIDDEN_STOP_S = 0.5
"""Time constant with which the predicted motion of an object slows down while it is hidden."""

PARTED_S = 0.4
"""An object that has looked like two for this long is divided into two."""


class Matcher:
    """Associates the fragments of one frame with the tracked objects.

    Args:
        targets: The objects.
        fragments: All fragments of the frame, the largest first.
        dt_s: Seconds since the last frame.
        scene: The pixels of the frame; None to match without appearance.
        convex: Whether each fragment is an object, none a part of one.
    """

    def __init__(
        self,
        targets: Targets,
        fragments: list[Fragment],
        dt_s: float,
        scene: Scene | None,
        *,
        convex: bool = False,
    ) -> None:
        self._targets = targets
        self._fragments = fragments
        self._dt_s = dt_s
        self._scene = scene
        self._convex = convex
        self._hidden: list[Target] = []  # in a shared region, no fragment looks like them
        self._lost: list[Target] = []  # confirmed, not seen lately, without a fragment

    def match(self) -> list[Fragment]:
        """Correct the predicted objects by their fragments; return the fragments without one."""
        targets, fragments = self._targets.all, self._fragments
        if not targets or not fragments:
            return fragments
        links = self._links(targets)
        self._lost = [
            targets[row]
            for row in np.flatnonzero(~links.any(axis=1))
            if targets[row].confirmed and targets[row].missing_s(self._targets.now_ns) > SHOWN_S
        ]
        for rows, columns in association.components(links):
            owned = [fragments[column] for column in columns]
            members = [targets[row] for row in rows]
            if len(members) == 1:
                self._follow_one(members[0], owned)
            else:
                self._follow_several(members, owned)
        free = _unlinked_columns(links)
        hidden = [target for target in self._hidden if target in self._targets.all]
        for target, column in self._turned(hidden, free):
            self._follow_one(target, [fragments[column]])
            free.remove(column)
            hidden.remove(target)
        for target in hidden:
            if target.turned_to is None and self._among_others(target, targets, links) is None:
                # After the search, for which its last place and speed are needed.
                target.slow_down(math.exp(-self._dt_s / HIDDEN_STOP_S))
            else:
                target.correct(target.box.center, self._targets.now_ns)
        return [fragments[column] for column in free]

    def _links(self, targets: list[Target]) -> NDArray[np.bool_]:
        """Return which fragments may belong to which targets: (targets, fragments)."""
        boxes = [target.box for target in targets]
        links = association.overlaps(boxes, self._fragments) > OVERLAP
        for row, target in enumerate(targets):
            missing_s = target.missing_s(self._targets.now_ns) - self._dt_s
            if missing_s > SHOWN_S and target.grouped_ns is None:
                links[row] = False
        self._link_the_rest(links)
        unlinked = [targets[row] for row in np.flatnonzero(~links.any(axis=1))]
        for target, column in self._turned(unlinked, _unlinked_columns(links)):
            links[targets.index(target), column] = True
        for row in np.flatnonzero(~links.any(axis=1)).tolist():
            region = self._among_others(targets[row], targets, links)
            if region is not None:
                links[row, region] = True
        return links

    def _link_the_rest(self, links: NDArray[np.bool_]) -> None:
        """Link targets and fragments that have no link yet, by minimum-cost assignment."""
        fragments, scene = self._fragments, self._scene
        rows = np.flatnonzero(~links.any(axis=1))
        columns = np.flatnonzero(~links.any(axis=0))
        if not rows.size or not columns.size:
            return
        costs = np.full((rows.size, columns.size), association.IMPOSSIBLE)
        centers = np.array([fragments[column].center for column in columns])
        areas = np.array([fragments[column].area for column in columns])
        for number, row in enumerate(rows):
            target = self._targets.all[row]
            deviations = [
                math.sqrt(axis.pp) + GATE_SIDES / 2 * target.side for axis in (target.x, target.y)
            ]
            away = np.square((centers[:, 0] - target.x.position) / deviations[0])
            away += np.square((centers[:, 1] - target.y.position) / deviations[1])
            ratio = np.abs(np.log((areas + 1) / (target.area + 1)))
            fits = (away < 4.0) & (ratio < 1.2)
            costs[number, fits] = (away + ratio)[fits]
            if scene is None or target.missing_s(self._targets.now_ns) < SHOWN_S:
                continue
            for column in np.flatnonzero(fits):
                difference = target.appearance.distance(scene, fragments[columns[column]])
                costs[number, column] += 3 * difference
                if difference > OTHER_APPEARANCE:
                    costs[number, column] = association.IMPOSSIBLE
        for number, found in association.assigned(costs):
            links[rows[number], columns[found]] = True

    def _turned(self, candidates: list[Target], columns: list[int]) -> list[tuple[Target, int]]:
        """Return each object that turned since the last frame with the fragment that looks like it.

        An object that bounces is not at its predicted place, but it is no farther from its last
        place than its speed allows. At its predicted place there may be the region of another
        object, which does not look like it.

        Args:
            candidates: Objects that were not found where they were expected.
            columns: Numbers of the fragments that may be theirs.
        """
        scene, targets, dt_s = self._scene, self._targets, self._dt_s
        if scene is None or dt_s > SHOWN_S:
            return []
        turned = [each for each in candidates if each.missing_s(targets.now_ns) <= dt_s]
        costs = np.full((len(turned), len(columns)), association.IMPOSSIBLE)
        for number, target in enumerate(turned):
            last, reach = self._last_place(target)
            for place, column in enumerate(columns):
                found = self._fragments[column]
                away = math.dist(last, found.center) / reach
                if away > 1 or not 1 / PLAUSIBLE < (found.area + 1) / (target.area + 1) < PLAUSIBLE:
                    continue
                difference = target.appearance.distance(scene, found)
                if difference <= OTHER_APPEARANCE:
                    costs[number, place] = away + difference
        return [(turned[number], columns[place]) for number, place in association.assigned(costs)]

    def _among_others(
        self, target: Target, targets: list[Target], links: NDArray[np.bool_]
    ) -> int | None:
        """Return the number of the fragment of other objects in which an object has turned.

        It is then expected where its colours are found; its state is corrected by the pixels that
        are its own, as in any shared region, or by that place if these are too few. The colours of
        all these objects must be well known, and the fragment larger than the others would be
        alone.
        """
        scene, dt_s = self._scene, self._dt_s
        if (
            scene is None
            or dt_s > SHOWN_S
            or self._targets.since_s(target.clear_ns) > dt_s
            or target.alone_s < PROVEN_S
        ):
            return None
        last, reach = self._last_place(target)
        found: list[tuple[float, int, tuple[float, float]]] = []
        for column in np.flatnonzero(links.any(axis=0)).tolist():
            region = self._fragments[column]
            linked = [targets[row] for row in np.flatnonzero(links[:, column])]
            others = [each for each in linked if each is not target]
            usual = sum(each.area for each in others)
            if region.area < usual + LEAST_MORE * target.area:
                continue
            if all(each.alone_s >= PROVEN_S for each in others):
                share, place = found_in(region, target, others, last, reach, scene)
                found.append((share, column, place))
        share, column, place = max(found, default=(0.0, 0, last))
        if share < LEAST_FOUND:
            return None
        target.turned_to = place
        return column

    def _last_place(self, target: Target) -> tuple[tuple[float, float], float]:
        """Return where an object was in the last frame, and how far from there it may be now."""
        x, y = (axis.position - axis.velocity * self._dt_s for axis in (target.x, target.y))
        return (x, y), (GATE_SIDES + max(target.speed, TURNING_SPEED) * self._dt_s) * target.side

    def _lost_before(self, new: Target, found: Fragment) -> Target | None:
        """Return the lost object of which a new track has turned out to be the continuation.

        An object that comes out from behind something is a narrow part at first, in which it is
        not recognized.
        """
        if self._scene is None or new.confirmed:
            return None
        for lost in self._lost:
            if (
                lost.seen_ns < new.born_ns  # nor continued by another track in this frame
                and association.overlap(found, lost.box) > OVERLAP
                and 1 / PLAUSIBLE < found.area / max(1.0, lost.area) < PLAUSIBLE
                and lost.appearance.distance(self._scene, found) <= OTHER_APPEARANCE
            ):
                return lost
        return None

    def _follow_one(self, target: Target, owned: list[Fragment]) -> None:
        lost = self._lost_before(target, union(owned))
        if lost is not None:
            self._targets.drop(target.id)
            target = lost
        parts = _two_of(owned) if self._convex else _parts(target, owned)
        now_ns = self._targets.now_ns
        if parts is None:
            target.parted_ns = None
        elif target.parted_ns is None:
            target.parted_ns = now_ns
        elif self._targets.since_s(target.parted_ns) >= PARTED_S:
            self._split(target, parts)
            return
        if target.grouped_ns is not None and not self._near_another(target):
            target.grouped_ns = None  # its foreground is no longer shared with others
        self._measure(target, owned, alone=parts is None)

    def _near_another(self, target: Target) -> bool:
        """Return whether another object, possibly hidden, is expected in the target's box."""
        box = target.box
        return any(
            association.overlap(box, each.box) > 0
            for each in self._targets.all
            if each is not target
        )

    def _follow_several(self, members: list[Target], owned: list[Fragment]) -> None:
        """Correct objects that are linked with the same fragments."""
        pairs = _one_for_each(members, owned, self._scene)
        if pairs is not None:
            taken = {number for _, number in pairs}
            for row, number in pairs:
                target = members[row]
                mine = [owned[number]]
                for other in range(len(owned)):
                    if other not in taken and _nearest(members, owned[other]) is target:
                        mine.append(owned[other])
                self._measure(target, mine, alone=True)
            return
        members = merging.without_parts(members, union(owned), self._targets)
        if len(members) == 1:
            self._measure(members[0], owned, alone=False)
            return
        portions = None if self._scene is None else divide(members, owned, self._scene)
        for number, target in enumerate(members):
            target.grouped_ns = self._targets.now_ns
            target.parted_ns = None
            if portions is None:
                target.correct((target.x.position, target.y.position), self._targets.now_ns)
            elif not measure_portion(target, portions[number], self._targets):
                self._hidden.append(target)
        merging.drop_duplicates(members, union(owned), self._targets)
        merging.join_stacked(members, self._targets)

    def _measure(self, target: Target, owned: list[Fragment], *, alone: bool) -> None:
        measure(target, union(owned), self._targets, self._dt_s, self._scene, alone=alone)

    def _split(self, target: Target, parts: tuple[Fragment, Fragment]) -> None:
        """Divide an object into two; the part that is nearer and more similar keeps its id."""
        costs = []
        for part in parts:
            x, y = part.center
            away = math.hypot(x - target.x.position, y - target.y.position) / target.side
            difference = (
                0.5 if self._scene is None else target.appearance.distance(self._scene, part)
            )
            costs.append(away + difference)
        mine, other = parts if costs[0] <= costs[1] else parts[::-1]
        target.parted_ns = None
        target.resize(mine.width, mine.height, mine.area, 1.0)
        target.appearance, target.whole = Appearance(), (0.0, 0.0)
        target.correct(mine.center, self._targets.now_ns)
        split = self._targets.begin(other)
        if split is not None:
            split.x.velocity, split.y.velocity = target.x.velocity, target.y.velocity
            split.confirmed = target.confirmed
            split.travelled = target.travelled
            split.full = target.full
        for each in (target, split):
            if each is not None and self._scene is not None:
                each.appearance.learn(self._scene, each.box, 1.0)


def _unlinked_columns(links: NDArray[np.bool_]) -> list[int]:
    return [int(column) for column in np.flatnonzero(~links.any(axis=0))]


def _two_of(owned: list[Fragment]) -> tuple[Fragment, Fragment] | None:
    """Return the largest two fragments of a target if each is an object; None if there is one."""
    return (owned[0], owned[1]) if len(owned) > 1 else None


def _parts(target: Target, owned: list[Fragment]) -> tuple[Fragment, Fragment] | None:
    """Return a left and a right part if the fragments of a target look like two objects."""
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
    """Return pairs of targets and fragments, one for each target; None if that is not possible."""
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
            away = math.dist(fragment.center, target.box.center) / target.side
            difference = 0.0
            if scene is not None and target.grouped_ns is not None:
                difference = 2.0 * target.appearance.distance(scene, fragment)
            if away < 1.5:
                costs[row, column] = away + difference
    pairs = association.assigned(costs)
    return pairs if len(pairs) == len(members) else None


def _nearest(members: list[Target], fragment: Fragment) -> Target:
    x, y = fragment.center
    return min(
        members,
        key=lambda each: (
            abs(x - each.box.center[0]) / each.width + abs(y - each.box.center[1]) / each.height,
            each.id,
        ),
    )
