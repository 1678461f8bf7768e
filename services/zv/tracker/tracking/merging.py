"""Ends tracks that are parts or duplicates of another object in the same region."""

from __future__ import annotations

from itertools import combinations

from zv.tracker.tracking import association
from zv.tracker.tracking.fragment import Fragment, union
from zv.tracker.tracking.target import Target
from zv.tracker.tracking.targets import Targets

PROVEN_S = 0.4
"""After being seen for this long alone, complete and away from the border, a track is an object of
its own."""

GROWN = 1.25
"""A region shows one object if its box is larger than the object's by less than this factor."""

STACKED_S = 1.0
STACKED_SHARE = 0.6
"""One box is on top of another if they share more than this part of their width, and little of
their height."""

DUPLICATE_SHARE = 0.8
LEAST_TWO = 1.2
"""A region with two objects has at least this many times the area of the larger one."""


def without_parts(members: list[Target], whole: Fragment, targets: Targets) -> list[Target]:
    """End the tracks of parts of objects in one region, and return the others.

    An object that enters the picture in several parts becomes one when these are connected: of the
    unproven tracks, only the largest stays. An unproven track beside a proven object, such as a
    head that was separate from its body, ends too if the shared region is only as large as that
    object.
    """
    unproven = [each for each in members if each.alone_s < PROVEN_S]
    largest = max(members, key=lambda each: (_whole_area(each), -each.id))
    kept = max(unproven, key=lambda each: (each.confirmed, each.area, -each.id), default=None)
    parts = {each.id for each in unproven if each is not kept}
    is_proven = largest.alone_s >= PROVEN_S
    if kept is not None and is_proven and not kept.confirmed and _fits(whole, largest):
        parts.add(kept.id)
        largest.become(whole)
    for number in parts:
        targets.drop(number)
    return [each for each in members if each.id not in parts]


def join_stacked(members: list[Target], targets: Targets) -> None:
    """Join two tracks of which one has been on top of the other for a while.

    They are parts of one object, divided by something in front of it.
    """
    ordered = sorted(members, key=lambda each: each.id)
    for number, younger in enumerate(ordered):
        older = next((each for each in ordered[:number] if _stacked(each.box, younger.box)), None)
        if older is None:
            younger.stacked_ns = None
        elif younger.stacked_ns is None:
            younger.stacked_ns = targets.now_ns
        elif targets.since_s(younger.stacked_ns) >= STACKED_S:
            targets.drop(younger.id)
            whole = union([older.box, younger.box])
            older.become(whole)


def drop_duplicates(members: list[Target], whole: Fragment, targets: Targets) -> None:
    """End the newer of two tracks that share the box of one object, unless it is confirmed."""
    ordered = sorted(members, key=lambda each: each.id)
    for one, two in combinations(ordered, 2):
        if association.overlap(one.box, two.box) <= DUPLICATE_SHARE:
            continue
        if whole.area < LEAST_TWO * max(one.area, two.area) and not two.confirmed:
            targets.drop(two.id)


def _fits(whole: Fragment, target: Target) -> bool:
    """Return whether the box of a region is about as large as that of an object."""
    width, height = max(target.width, target.whole[0]), max(target.height, target.whole[1])
    return whole.width < GROWN * width and whole.height < GROWN * height


def _whole_area(target: Target) -> float:
    """Return the area of an object's box or, if that is larger, of its recent whole size."""
    return max(target.width * target.height, target.whole[0] * target.whole[1])


def _stacked(one: Fragment, other: Fragment) -> bool:
    across = min(one.right, other.right) - max(one.left, other.left)
    along = min(one.bottom, other.bottom) - max(one.top, other.top)
    return across > STACKED_SHARE * min(one.width, other.width) and along < (
        1 - STACKED_SHARE
    ) * min(one.height, other.height)
