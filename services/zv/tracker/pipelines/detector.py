"""Tracks the objects that a model finds; background subtraction follows them between its runs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Final

import numpy as np

from zv.tracker.detector.class_names import Wanted
from zv.tracker.detector.model import Detection
from zv.tracker.foreground.foreground import ForegroundParameters
from zv.tracker.foreground.regions import RegionLimits, regions_of
from zv.tracker.pipelines.base import Image, PipelineWithIds
from zv.tracker.shapes import contains
from zv.tracker.tracking.box_association import ScoredBox
from zv.tracker.tracking.box_tracker import BoxTracker
from zv.tracker.tracking.region import Region
from zv.tracker.tracking.track import Track

UNSURE: Final = 0.1
"""Least score of a box that continues a track, below the one from which on a box begins one."""

WATCHED_S: Final = 1.0
"""The model goes on for this long after the last motion."""


PROTECTED_SPEED: Final = 0.1
"""What moves faster than this is not learned as background, sides per second."""


@dataclass(frozen=True, slots=True)
class DetectorParameters:
    """The parameters of ``DetectorTracker``."""

    # The classes that are kept, with their least scores.
    wanted: Wanted = field(default_factory=lambda: Wanted(0.5))
    every: int = 1  # the model runs on every so manieth frame; 0: whenever it is free
    on_motion: bool = False  # whether it runs only while something moves
    keep_lost_s: float = 2.0  # how long a track that is not seen is kept
    # Those of the background subtraction; their polygons say where to detect.
    foreground: ForegroundParameters = field(default_factory=ForegroundParameters)
    min_area: float = 0.0  # least region of motion, square pixels of the picture; 0: automatic
    at_foot: bool = False  # whether the foot of a box must be inside, not its centre


class DetectorTracker(PipelineWithIds):
    """Tracks the objects of one camera by the boxes of a model.

    For each frame, ``begin`` must be called, then ``finish``, with what the model found in it if it
    ran; ``late`` takes what it found in an earlier frame, between two frames.

    Attributes:
        parameters: May be set between two frames; the background and the tracks go on.
    """

    def __init__(self, parameters: DetectorParameters, first_id: int = 1) -> None:
        super().__init__(first_id)
        self.parameters = parameters
        self._tracker: BoxTracker | None = None
        self._regions: list[Region] = []
        # The tracker's time and the shift of recent frames by their stamp.
        self._times: dict[int, tuple[int, tuple[int, int]]] = {}
        self._ran_seq: int | None = None  # of the last finished frame that the model should see
        self._next_ran_seq: int | None = None  # the same, once the frame that was begun is finished
        self._moved_s: float | None = None

    def end_tracks(self) -> None:
        """End all tracks."""
        self._first_id, self._tracker, self.tracks = self.next_id, None, []
        self._size = None

    def begin(self, stamp_ns: int, seq: int, size: tuple[int, int], picture: Image | None) -> bool:
        """Begin a frame: predict the tracks to it, and look for motion.

        Args:
            stamp_ns: Its capture time.
            seq: Its number in its epoch.
            size: Its width and height.
            picture: Its pixels at a reduced size, as ``working_scale`` says, BGR; None without
                background subtraction.

        Returns:
            Whether the model should run on it.
        """
        if self._tracker is None or size != self._size:
            self._begin(size)
        assert self._tracker is not None
        self._tracker.keep_lost_s = self.parameters.keep_lost_s
        now_s = self._pass_time(stamp_ns)
        self._tracker.predict(now_s)
        self.shown = "scene"
        if picture is None:
            with self._lock:
                self._foreground, self._regions = None, []
        quiet = picture is not None and not self._find_motion(picture, now_s)
        self._times[stamp_ns] = self._now_ns, self.shift
        while len(self._times) > 500:
            del self._times[next(iter(self._times))]
        wanted, self._next_ran_seq = self.parameters, self._ran_seq
        if wanted.on_motion and quiet:
            return False
        step = wanted.every if self._ran_seq is None or seq < self._ran_seq else seq - self._ran_seq
        if step < wanted.every:
            return False
        self._next_ran_seq = seq
        return True

    def late(self, found: Sequence[Detection], stamp_ns: int) -> bool:
        """Process what the model found in an earlier frame; return whether that was of use."""
        if self._tracker is None or stamp_ns not in self._times:
            return False
        at_ns, shift = self._times[stamp_ns]
        return self._tracker.see_late(kept_boxes(found, self.parameters, shift), at_ns / 1e9)

    def finish(self, found: Sequence[Detection] | None) -> list[Track]:
        """Finish the frame that was begun.

        Args:
            found: What the model found in it; None if it did not run.

        Returns:
            The tracks, oldest first, in pixels of the frame.
        """
        assert self._tracker is not None
        self._ran_seq = self._next_ran_seq
        if found is not None:
            self._tracker.see(kept_boxes(found, self.parameters, self.shift))
        if self._foreground is not None:
            self._tracker.move(self._regions, seen=found is None)
        self.tracks = self._tracker.finish()
        self._choose_main()
        return self.tracks

    def _begin(self, size: tuple[int, int]) -> None:
        super()._begin(size)
        self._tracker = BoxTracker(size, self.next_id, self.parameters.keep_lost_s)
        self._ran_seq = self._moved_s = None

    def _find_motion(self, picture: Image, now_s: float) -> bool:
        """Return whether anything moves, has moved a moment ago, or cannot be judged yet."""
        wanted = self.parameters
        unknown = self._foreground is None or self._foreground.background is None
        _, strong = self._subtract(picture, now_s, self._known, wanted.foreground)
        least = self._least_area(wanted.min_area)
        found = regions_of(self.mask, strong, least, np.inf, RegionLimits())
        self._regions = [each.moved(*self.moved).scaled(self._scale) for each in found]
        if self._regions or unknown or self.shown == "other":
            self._moved_s = now_s
        return self._moved_s is not None and now_s - self._moved_s <= WATCHED_S

    def _known(self) -> list[Region]:
        """Return the boxes of the tracks, where the background is: they are not learned."""
        assert self._tracker is not None
        right, down = self.moved
        return [
            each.box.scaled(1 / self._scale).moved(-right, -down)
            for each in self._tracker.states
            if each.confirmed and each.speed > PROTECTED_SPEED
        ]


def kept_boxes(
    found: Sequence[Detection], wanted: DetectorParameters, shift: tuple[int, int] = (0, 0)
) -> list[ScoredBox]:
    """Return the boxes of the classes that are kept, where objects are detected.

    Args:
        found: In pixels of the frame.
        wanted: The classes, and where to detect.
        shift: By how many of these the frame was moved from the background.
    """
    kept = []
    for each in found:
        least = wanted.wanted.score_of(each.name)
        if least is None or each.score < min(least, UNSURE) or not _is_inside(each, wanted, shift):
            continue
        left, top, right, bottom = each.box
        region = Region(left, top, right, bottom, (right - left) * (bottom - top))
        kept.append(ScoredBox(region, each.score, each.name, least))
    return kept


def _is_inside(found: Detection, wanted: DetectorParameters, shift: tuple[int, int]) -> bool:
    regions, ignored = wanted.foreground.regions, wanted.foreground.ignored
    left, top, right, bottom = found.box
    x, y = (left + right) / 2, bottom if wanted.at_foot else (top + bottom) / 2
    point = x - shift[0], y - shift[1]
    inside = not regions or any(contains(each, point) for each in regions)
    return inside and not any(contains(each, point) for each in ignored)
