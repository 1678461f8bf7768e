"""Corrects an object's position, size and appearance by its foreground in one frame."""

from __future__ import annotations

import math

from zv.tracker.tracking.appearance import Scene
from zv.tracker.tracking.fragment import Fragment
from zv.tracker.tracking.groups import LEAST_CLEAR, Portion
from zv.tracker.tracking.target import SIZE_TIME_S, Target
from zv.tracker.tracking.targets import Targets

GROWN = 1.25
"""If a box differs from the expected size by more than this factor, only one edge is used."""

PLAUSIBLE = 1.7
"""Foreground whose area differs from the object's usual one by less than this factor is all of the
object: its bounding box is then the track's box, even if other poses had another size."""

WHOLE_TIME_S = 3.0
"""Time constant with which the largest size of an object fades while it is seen alone and
complete."""

APPEARANCE_TIME_S = 1.0
LEARN_EVERY_S = 0.15
GROUP_MEMORY_S = 1.5
"""For this long after an object was in a group, its size is not measured: others may be near."""

WHOLE = 0.75
"""If more than this share of its usual area is visible, an object in a group is in front."""

HELD_S = 1.5
"""An object that is hidden in a group counts as seen for this long."""

COVERED = 0.5


def measure(
    target: Target,
    found: Fragment,
    targets: Targets,
    dt_s: float,
    scene: Scene | None,
    *,
    alone: bool,
) -> None:
    """Correct an object by the bounding box of its own foreground.

    Args:
        target: The object.
        found: All of its foreground.
        targets: All objects, including this one.
        dt_s: Seconds since the last frame.
        scene: The pixels of the frame, from which the appearance is learned; None to not learn it.
        alone: Whether that foreground shows no other object.
    """
    expected, at_border = target.box, targets.at_border(found)
    if target.grouped_ns is not None and targets.since_s(target.grouped_ns) > GROUP_MEMORY_S:
        target.grouped_ns = None
    entering = not target.full
    dx, dy = (axis.velocity * dt_s if entering else None for axis in (target.x, target.y))
    x, width = _along(found.left, found.right, expected.left, expected.right, targets.size[0], dx)
    y, height = _along(found.top, found.bottom, expected.top, expected.bottom, targets.size[1], dy)
    complete = width and height
    if not at_border:
        target.full = True
    follows = entering or (alone and target.grouped_ns is None and not at_border)
    share = max(1 - math.exp(-dt_s / SIZE_TIME_S), 1 / (target.hits + 1))
    target.resize(
        found.width if width or follows else target.width,
        found.height if height or follows else target.height,
        found.area if complete or entering else target.area,
        1.0 if entering else share,
    )
    if at_border or 1 / PLAUSIBLE < found.area / max(1.0, target.area) < PLAUSIBLE:
        target.shown = found
    if alone and complete and target.full and not at_border:
        target.alone_s += dt_s
        faded = math.exp(-dt_s / WHOLE_TIME_S)
        across, down = target.whole
        target.whole = max(found.width, faded * across), max(found.height, faded * down)
    before = target.travelled
    if entering:  # it moves as its edge inside the picture; its box is the part in view
        target.correct((x, y), targets.now_ns)
        target.place_at(found.center)
    elif complete and found.pixels_at is not None:
        target.correct(target.steadied((x, y), found.pixels_at, share), targets.now_ns)
    else:
        target.correct((x, y), targets.now_ns, (width, height))
    target.clear_ns = targets.now_ns
    if target.speed > 0.2 or target.travelled > before:
        target.moved_ns = targets.now_ns
    since_s = targets.since_s(target.learned_ns)
    if scene is not None and alone and complete and since_s >= LEARN_EVERY_S:
        share = 1 - math.exp(-min(since_s, APPEARANCE_TIME_S) / APPEARANCE_TIME_S)
        target.appearance.learn(scene, _around(found.center, target), share)
        target.learned_ns = targets.now_ns


def measure_portion(target: Target, portion: Portion, targets: Targets) -> bool:
    """Correct an object by its portion of a region that it shares with others; False if hidden.

    While it is hidden, it counts as seen for up to ``HELD_S`` if there is foreground that may hide
    it.
    """
    box = portion.box
    if box is None or portion.clear < LEAST_CLEAR:
        if portion.covered > COVERED and targets.since_s(target.clear_ns) < HELD_S:
            target.seen_ns = targets.now_ns
        return False
    expected, whole = target.box, portion.visible > WHOLE
    left, top, right, bottom = portion.open
    x, width = _between(box.left, box.right, expected.left, expected.right, left, right, whole)
    y, height = _between(box.top, box.bottom, expected.top, expected.bottom, top, bottom, whole)
    if width and height and portion.visible < PLAUSIBLE:
        target.shown = box
    target.clear_ns = targets.now_ns
    target.correct((x, y), targets.now_ns)
    return True


def _around(middle: tuple[float, float], target: Target) -> Fragment:
    """Return a box of the object's size around a measured centre."""
    (x, y), half_width, half_height = middle, target.width / 2, target.height / 2
    return Fragment(x - half_width, y - half_height, x + half_width, y + half_height, target.area)


def _along(
    low: float,
    high: float,
    expected_low: float,
    expected_high: float,
    end: int,
    moved: float | None,
) -> tuple[float, bool]:
    """Return the centre of a box along one axis, and whether its length there is reliable.

    If the length is not the expected one, since only a part is seen or another object is beside
    it, the centre is measured from the edge that is nearer to the expected one. While an object
    enters the picture, having ``moved`` since the last frame, the edge inside of the picture is
    used.
    """
    length, expected = high - low, max(1e-6, expected_high - expected_low)
    cut_low, cut_high = low <= 1, high >= end - 1
    if moved is not None:
        cut_low = cut_low or expected_low - moved <= 1
        cut_high = cut_high or expected_high - moved >= end - 1
    if cut_low and not cut_high:
        return high - expected / 2, False
    if cut_high and not cut_low:
        return low + expected / 2, False
    if moved is not None or 1 / GROWN < length / expected < GROWN:
        return (low + high) / 2, True
    if abs(low - expected_low) < abs(high - expected_high):
        return low + expected / 2, False
    return high - expected / 2, False


def _between(
    low: float,
    high: float,
    expected_low: float,
    expected_high: float,
    open_low: bool,
    open_high: bool,
    whole: bool,
) -> tuple[float, bool]:
    """Return the centre of a portion along one axis, and whether it is seen from end to end.

    At an edge that is not open, another object may hide the rest. The centre is then measured from
    the other edge if that one is open, else from the edge that is nearer to the expected one.
    """
    expected = expected_high - expected_low
    if whole or (open_low and open_high and high - low > expected / GROWN):
        return (low + high) / 2, True
    if open_low == open_high:
        open_low = abs(low - expected_low) < abs(high - expected_high)
    return (low + expected / 2 if open_low else high - expected / 2), False
