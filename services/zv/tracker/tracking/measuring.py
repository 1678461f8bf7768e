"""Corrects an object's position, size and colours by its foreground in one frame."""

from __future__ import annotations

import math
from dataclasses import dataclass

from zv.tracker.tracking.appearance import Scene, learned
from zv.tracker.tracking.region import Region
from zv.tracker.tracking.state import MOTION, TrackState


@dataclass(frozen=True, slots=True)
class MeasuringLimits:
    """The constants of measuring."""

    # If a box differs from the expected size by more than this factor, only one edge is used.
    grown: float = 1.25
    colors_s: float = 1.0  # time constant of the colours, seconds,
    learn_every_s: float = 0.15  # and the interval in which it is learned
    border: float = 0.02  # width of the border of the picture, as a share of its smaller side


LIMITS = MeasuringLimits()


@dataclass(frozen=True, slots=True)
class Moment:
    """A frame without its pixels."""

    now_s: float  # its time, seconds; it never goes back
    dt_s: float  # seconds since the last frame
    size: tuple[int, int]  # width and height of the mask

    def cut(self, box: Region) -> tuple[bool, bool, bool, bool]:
        """Return which edges of a box are at the border of the picture, which may cut it off."""
        (width, height), margin = self.size, self.margin
        return (
            box.left <= margin,
            box.top <= margin,
            box.right >= width - margin,
            box.bottom >= height - margin,
        )

    def at_border(self, box: Region) -> bool:
        """Return whether a box reaches the border of the picture."""
        return any(self.cut(box))

    @property
    def margin(self) -> float:
        """Width of the border of the picture, pixels: the outermost rows may be dark or blurred."""
        return max(1.0, LIMITS.border * min(self.size))


def measure(track: TrackState, found: Region, moment: Moment, scene: Scene) -> None:
    """Correct an object by the bounding box of its own foreground.

    Args:
        track: The object, predicted to the moment.
        found: All of its foreground, which shows no other object.
        moment: The frame.
        scene: The pixels of the frame, from which its colours are learned.
    """
    at_border, now_s = moment.at_border(found), moment.now_s
    entering = not track.was_inside
    dx, dy = (axis.velocity * moment.dt_s if entering else None for axis in (track.x, track.y))
    (x, width), (y, height) = _centre(found, track, moment, (dx, dy))
    complete = width and height
    track.was_inside |= not at_border
    follows = entering or not track.grouped
    share = max(1 - math.exp(-moment.dt_s / MOTION.size_s), 1 / (track.hits + 1))
    track.resize(
        found.width if width or follows else track.width,
        found.height if height or follows else track.height,
        found.area if complete or follows else track.area,
        1.0 if entering else share,
    )
    track.shown = found
    track.alone_s += moment.dt_s
    if entering:  # it moves as its edge inside the picture; its box is the part in view
        track.correct((x, y), now_s)
        track.place_at(found.center)
    elif complete and found.pixels_at is not None:
        track.correct(track.steadied((x, y), found.pixels_at, share), now_s)
    else:
        track.correct((x, y), now_s, (width, height))
    since_s = now_s - track.learned_s
    if complete and since_s >= LIMITS.learn_every_s:
        share = 1 - math.exp(-min(since_s / LIMITS.colors_s, 1.0))
        track.colors = learned(track.colors, scene, found, share)
        track.learned_s = now_s


def measure_portion(
    track: TrackState, portion: Region | None, moment: Moment, least: float
) -> None:
    """Correct an object by its portion of a region that it shares, if that has the least area."""
    if portion is None or portion.area < least:
        return
    (x, _), (y, _) = _centre(portion, track, moment)
    track.correct((x, y), moment.now_s)


def _centre(
    found: Region,
    track: TrackState,
    moment: Moment,
    moved: tuple[float | None, float | None] = (None, None),
) -> tuple[tuple[float, bool], tuple[float, bool]]:
    """Return the centre of a box along x and y, each with whether its length there is reliable."""
    expected, (width, height), margin = track.box, moment.size, moment.margin
    across, along = (found.left, found.right), (found.top, found.bottom)
    return (
        _along(across, (expected.left, expected.right), width, margin, moved[0]),
        _along(along, (expected.top, expected.bottom), height, margin, moved[1]),
    )


def _along(
    found: tuple[float, float],
    expected: tuple[float, float],
    end: int,
    margin: float,
    moved: float | None,
) -> tuple[float, bool]:
    """Return the centre of a box along one axis, and whether its length there is reliable.

    If the length is not the expected one, since only a part is seen or another object is beside
    it, the centre is measured from the edge that is nearer to the expected one. While an object
    enters the picture, having ``moved`` since the last frame, the edge inside of the picture is
    used.
    """
    (low, high), (expected_low, expected_high) = found, expected
    half = max(1e-6, expected_high - expected_low) / 2
    ratio = (high - low) / (2 * half)
    cut_low, cut_high = low <= margin, high >= end - margin
    if moved is not None:
        cut_low = cut_low or expected_low - moved <= margin
        cut_high = cut_high or expected_high - moved >= end - margin
    if cut_low and not cut_high:
        return high - half, False
    if cut_high and not cut_low:
        return low + half, False
    if moved is not None or 1 / LIMITS.grown < ratio < LIMITS.grown:
        return (low + high) / 2, True
    if abs(low - expected_low) < abs(high - expected_high):
        return low + half, False
    return high - half, False
