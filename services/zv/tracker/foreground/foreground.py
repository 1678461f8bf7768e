"""Finds the foreground of each frame of a fixed camera."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import cv2
import numpy as np
from numpy.typing import NDArray

from zv.tracker.foreground.background import Background, BackgroundLimits
from zv.tracker.foreground.light import LightLimits
from zv.tracker.foreground.steadying import (
    Steadier,
    SteadyLimits,
    clear_unseen,
    moved_back,
    reduced,
)
from zv.tracker.foreground.view import Shown, View, ViewLimits
from zv.tracker.tracking.region import Region

Image = NDArray[np.uint8]

Polygon = Sequence[tuple[float, float]]
"""Corners x, y in full-resolution pixels."""


@dataclass(frozen=True, slots=True)
class SceneLimits:
    """The constants of changes of the whole scene."""

    silent_s: float = 0.5  # nothing is foreground for this long after the start, seconds
    # If a larger share of what no known object hides is foreground, it is another view, and
    # nothing of it is an object.
    changed: float = 0.5
    changed_s: float = 0.5  # after this time, which fades as it grew, the other view is learned
    every_s: float = 0.1  # interval in which edges are compared, seconds
    # A camera that was pushed by more pixels than this is steadied no more, but its view learned
    # anew while it shows no object,
    pushed: int = 2
    stays_s: float = 10.0  # when it has stayed at its new place for this long, seconds
    # Margin around the box of an object that is not learned, for arms and feet: a share of its
    # longer side.
    margin: float = 0.1
    least_margin: float = 2.0  # the same, pixels


@dataclass(frozen=True, slots=True)
class ForegroundParameters:
    """The parameters of ``ForegroundDetector``."""

    var_threshold: float = 25.0  # squared distance above which a pixel is foreground
    detect_shadows: bool = True
    learning_s: float = 10.0  # time after which a change has become background by 63 %
    frozen: bool = False  # do not learn
    regions: tuple[Polygon, ...] = ()  # detect only inside these; none: everywhere
    ignored: tuple[Polygon, ...] = ()  # do not detect inside these
    background: BackgroundLimits = field(default_factory=BackgroundLimits)
    light: LightLimits = field(default_factory=LightLimits)
    scene: SceneLimits = field(default_factory=SceneLimits)
    view: ViewLimits = field(default_factory=ViewLimits)
    steady: SteadyLimits = field(default_factory=SteadyLimits)


class ForegroundDetector:
    """Finds the foreground of each picture of a fixed camera.

    Args:
        parameters: Those of the background, and where to detect; an attribute, which may be set.
        scale: Full-resolution pixels per pixel of the pictures, for the polygons.

    Attributes:
        moved: By how many pixels, x and y, the newest picture was moved from the background.
        blind: Whether the regions leave nothing of the picture where objects are detected.
    """

    def __init__(self, parameters: ForegroundParameters, scale: float = 1.0) -> None:
        self._scale = scale
        self._searched: Image | None = None  # where objects are detected; None: everywhere
        self._searched_of: tuple[object, ...] = ()
        self.blind = False
        self.parameters = parameters
        self._view = View(parameters.view)
        self._steadier = Steadier(parameters.steady)
        self.moved = 0, 0
        self._seen: Image | None = None  # the newest picture, before it was moved back,
        self._small: Image | None = None  # and reduced
        self._place, self._place_s = (0, 0), 0.0  # ``moved`` of the camera's place, and since when
        self._shown: Shown = "scene"
        self._started_s = self._passed_s = self._looked_s = self._other_s = 0.0
        self.reset()

    def reset(self) -> None:
        """Learn the background anew from the next picture on."""
        self.background: Background | None = None

    def steadied(self, picture: Image) -> Image:
        """Return a picture moved back to where the background is, if the camera shakes."""
        self._seen, self._small = picture, reduced(picture)
        if self.background is None:
            self.moved = 0, 0
        else:
            self.moved = self._steadier.moved(self.background.shown, self._small)
        return moved_back(picture, self.moved)

    def update(
        self, picture: Image, now_s: float, known: Sequence[Region]
    ) -> tuple[Image, Image, Shown]:
        """Return the foreground of a picture, and learn from it.

        Args:
            picture: (height, width, 3) uint8 BGR, of the same size each time.
            now_s: Its time, seconds; it never goes back.
            known: Boxes of known objects, which are not learned.

        Returns:
            The mask, (height, width) uint8 of 0 and 255; its strong pixels; and what the picture
            shows: ``other`` once, when another view begins to be learned, or if nothing is to be
            learned, for as long as that is shown.
        """
        wanted, limits = self.parameters, self.parameters.scene
        height, width = picture.shape[:2]
        self._follow_area(height, width)
        if self.background is None:
            self._start(picture, now_s)
        assert self.background is not None
        background = self.background
        is_pushed = self._is_pushed(now_s)
        seen = picture if self._seen is None else self._seen
        hidden = self._hidden(known, (height, width))
        age_s = now_s - self._started_s
        self._look(picture, hidden, age_s)
        if not wanted.frozen and self._shown == "scene":
            background.start(picture, age_s)
        background.adjust((wanted.var_threshold / 25.0) ** 0.5)
        background.follow_light(picture, hidden)
        mask, strong = background.foreground(picture, shadows=wanted.detect_shadows)
        shown, silent = self._shown, age_s < limits.silent_s or self._shown == "nothing"
        elapsed_s, self._passed_s = age_s - self._passed_s, age_s
        if not silent and (shown == "other" or self._is_hidden(mask, hidden)):
            silent = True
            more_s = min(elapsed_s, limits.changed_s / 2)  # not by one picture alone
            self._other_s = min(limits.changed_s, self._other_s + more_s)
            shown = "other" if self._other_s >= limits.changed_s else "scene"
            if shown == "other" and not wanted.frozen:
                self._start(seen, now_s)
        else:
            self._other_s = max(0.0, self._other_s - elapsed_s)
            if shown == "scene" and not wanted.frozen:
                background.learn(picture, age_s, hidden, wanted.learning_s)
        if silent:
            mask = np.zeros_like(mask)
            return mask, mask, shown
        for each in (mask, strong):
            clear_unseen(each, self.moved)
        if self._searched is not None:
            mask = np.asarray(cv2.bitwise_and(mask, self._searched), np.uint8)
            strong = np.asarray(cv2.bitwise_and(strong, self._searched), np.uint8)
        if is_pushed and not (wanted.frozen or known or strong.any()):
            self._start(seen, now_s)
            shown = "other"
        return mask, strong, shown

    def is_cut(self, box: Region, margin: float) -> bool:
        """Return whether a box reaches, within a margin in pixels, where nothing is detected.

        That is outside of the regions, or what the newest picture, moved back, does not show.
        """
        if self.background is None or (self._searched is None and not any(self.moved)):
            return False
        if self._searched is None:
            detected = np.full(self.background.unlit.shape[:2], 255, np.uint8)
        else:
            detected = self._searched.copy()
        clear_unseen(detected, self.moved)
        left, top, right, bottom = box[:4]
        rows = slice(max(0, round(top - margin)), max(0, round(bottom + margin)))
        columns = slice(max(0, round(left - margin)), max(0, round(right + margin)))
        return not detected[rows, columns].all()

    def _is_pushed(self, now_s: float) -> bool:
        """Return whether the camera has been at another place than the background's for long."""
        limits = self.parameters.scene
        if max(abs(now - then) for now, then in zip(self.moved, self._place, strict=True)) > 1:
            self._place, self._place_s = self.moved, now_s
        return max(map(abs, self._place)) > limits.pushed and now_s - self._place_s > limits.stays_s

    def _follow_area(self, height: int, width: int) -> None:
        """Find where objects are detected, 255, and ignored, 0, if that is not known already."""
        regions, ignored = self.parameters.regions, self.parameters.ignored
        searched_of = (height, width, regions, ignored)
        if searched_of == self._searched_of:
            return
        self._searched_of, self._searched, self.blind = searched_of, None, False
        if not (regions or ignored):
            return
        mask = np.full((height, width), 0 if regions else 255, np.uint8)
        # OpenCV also fills the pixels on the outline. Corners are given in 1/16 pixels (shift=4).
        for polygons, value in ((regions, 255), (ignored, 0)):
            for polygon in polygons:
                corners = np.round((np.asarray(polygon, float) / self._scale - 0.5) * 16)
                cv2.fillPoly(mask, [corners.astype(np.int32)], (value,), shift=4)
        self._searched, self.blind = mask, not mask.any()

    def _look(self, picture: Image, hidden: Image | None, age_s: float) -> None:
        """Compare the view with the background, when that is due."""
        assert self.background is not None
        elapsed_s = age_s - self._looked_s
        if elapsed_s >= self.parameters.scene.every_s:
            self._looked_s = age_s
            known = self._small if picture is self._seen else None
            small = reduced(picture) if known is None else known
            self._shown = self._view.shown(self.background.unlit, small, hidden, elapsed_s)

    def _is_hidden(self, mask: Image, hidden: Image | None) -> bool:
        """Return whether most of what no known object hides is foreground."""
        total, marked = mask.size, cv2.countNonZero(mask)
        if hidden is not None:
            total -= cv2.countNonZero(hidden)
            marked -= cv2.countNonZero(cv2.bitwise_and(mask, hidden))
        return marked > self.parameters.scene.changed * total

    def _start(self, picture: Image, now_s: float) -> None:
        self.background = Background(picture, self.parameters.background, self.parameters.light)
        self._view = View(self.parameters.view)
        self._shown, self.moved = "scene", (0, 0)
        self._started_s = now_s
        self._passed_s = self._looked_s = self._other_s = 0.0

    def _hidden(self, boxes: Sequence[Region], size: tuple[int, int]) -> Image | None:
        """Return what of the background is not in the picture, not 0; None if all of it is."""
        if not (boxes or any(self.moved)):
            return None
        limits = self.parameters.scene
        mask = np.zeros(size, np.uint8)
        for box in boxes:
            margin = max(limits.least_margin, limits.margin * max(box.width, box.height))
            rows = slice(max(0, round(box.top - margin)), max(0, round(box.bottom + margin)))
            mask[rows, max(0, round(box.left - margin)) : max(0, round(box.right + margin))] = 255
        if any(self.moved):
            seen = np.full(size, 255, np.uint8)
            clear_unseen(seen, self.moved)
            mask = np.asarray(cv2.bitwise_or(mask, cv2.bitwise_not(seen)), np.uint8)
        return mask
