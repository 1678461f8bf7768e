"""Finds the foreground of each frame of a fixed camera, robustly against light and shadows."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from zv.tracker.foreground.background import SHADOW, BackgroundModel, Subtractor
from zv.tracker.foreground.dynamic_background import DynamicBackground
from zv.tracker.foreground.ghosts import GhostFinder
from zv.tracker.foreground.initial_background import InitialBackground
from zv.tracker.foreground.lighting import relit, same_texture
from zv.tracker.foreground.regions import Polygon, region_mask
from zv.tracker.tracking.fragment import Fragment

Image = NDArray[np.uint8]

CHANGED_SHARE = 0.25
"""If a larger share of the picture differs, a change of the light is tested for."""

SAME_CHANGE_S = 1.0
"""Changes of the light that follow each other faster count as one, as when a cloud comes."""

SAME_TEXTURE = 0.5
RELIT_SHARE = 0.5
MOVED_S = 0.5
"""If most of the picture differs for this long, the background is learned anew."""

MARGIN, LEAST_MARGIN = 0.1, 2.0
"""Margin protected around a box, for arms and feet: a share of its longer side, and at least so
many pixels."""

SILENT_S = 1.0
"""Nothing is foreground for this long after the start, while the background is unknown."""


@dataclass(frozen=True, slots=True)
class ForegroundParameters:
    """The parameters of ``ForegroundDetector``."""

    subtractor: Subtractor = "mog2"
    var_threshold: float = 25.0  # squared distance above which a pixel is foreground
    detect_shadows: bool = True
    learning_s: float = 10.0  # time after which a change has become background by 63 %
    frozen: bool = False  # do not learn
    regions: tuple[Polygon, ...] = ()  # detect only inside these; none: everywhere
    ignored: tuple[Polygon, ...] = ()  # do not detect inside these


class ForegroundDetector:
    """Finds the foreground of each picture of a fixed camera.

    Args:
        parameters: Those of the background model, and where to detect.
        scale: Full-resolution pixels per pixel of the pictures, for the polygons.

    Attributes:
        background: The learned background.
    """

    def __init__(self, parameters: ForegroundParameters, scale: float = 1.0) -> None:
        self.background = BackgroundModel(parameters.subtractor)
        self._scale = scale
        self._searched: Image | None = None
        self._size: tuple[int, int] | None = None
        self._parameters = parameters
        self.adjust(parameters)
        self.reset()

    @property
    def changes(self) -> Image | None:
        """How often each pixel has changed lately; None before two pictures, and while frozen."""
        return None if self._parameters.frozen else self._dynamic.changes

    @property
    def counted_s(self) -> float:
        """For how long changes of pixels have been counted."""
        return self._dynamic.counted_s

    def adjust(self, parameters: ForegroundParameters) -> None:
        """Continue with other parameters; the background is kept unless the subtractor changes."""
        if parameters.subtractor != self.background.subtractor:
            self.background = BackgroundModel(parameters.subtractor)
            self.reset()
        self.background.adjust(parameters.var_threshold, detect_shadows=parameters.detect_shadows)
        polygons = parameters.regions, parameters.ignored
        if polygons != (self._parameters.regions, self._parameters.ignored):
            self._size = None
        self._parameters = parameters

    def reset(self) -> None:
        """Learn the background anew from the next picture on."""
        self._started_ns: int | None = None
        self._initial: InitialBackground | None = None
        self._differs_ns: int | None = None
        self._relit_ns: int | None = None
        self._ghosts = GhostFinder()
        self._dynamic = DynamicBackground()

    def update(
        self, picture: Image, stamp_ns: int, known: Sequence[Fragment]
    ) -> tuple[Image, bool]:
        """Return the foreground of a picture, and learn from it.

        Args:
            picture: (height, width, 3) uint8 BGR, of the same size each time.
            stamp_ns: When it was taken.
            known: Boxes of known objects, which are not learned.

        Returns:
            The mask, (height, width) uint8 of 0 and 255; and whether the light of the whole scene
            or the view has changed, so that the background was adapted or learned anew.
        """
        height, width = picture.shape[:2]
        if self._size != (width, height):
            self._size = width, height
            self._searched = region_mask(
                self._size, self._scale, self._parameters.regions, self._parameters.ignored
            )
        if self._started_ns is None or stamp_ns < self._started_ns:
            self._start(picture, stamp_ns)
            return np.zeros((height, width), np.uint8), False
        known_mask = _boxes_mask(known, (height, width))
        silent = (stamp_ns - self._started_ns) / 1e9 < SILENT_S
        marked, changed = self._marked(picture, stamp_ns, known_mask), False
        mask = _cleaned(marked)
        if not self._parameters.frozen:
            self._learn_initial(picture, stamp_ns, known_mask)
            if silent:
                known_mask = None
            elif cv2.countNonZero(marked) > CHANGED_SHARE * marked.size:
                mask, changed = self._adapt(picture, stamp_ns, marked, known_mask)
            else:
                self._differs_ns = None
            if self._ghosts.due(stamp_ns):
                self._forget_ghosts(picture, stamp_ns, marked, known_mask)
            self.background.learn(picture, stamp_ns, known_mask, self._parameters.learning_s)
        if silent:
            return np.zeros((height, width), np.uint8), False
        if self._searched is not None:
            mask = np.asarray(cv2.bitwise_and(mask, self._searched), np.uint8)
        return mask, changed

    def _marked(self, picture: Image, stamp_ns: int, known: Image | None) -> Image:
        """Return the foreground and its shadows, without the usual colours of dynamic pixels."""
        marked = self.background.foreground(picture)
        if not self._parameters.frozen:
            self._dynamic.learn(picture, marked, known, stamp_ns, self.background.picture())
        self._dynamic.unmark(picture, self.background.limits, marked)
        return marked

    def _forget_ghosts(
        self, picture: Image, stamp_ns: int, marked: Image, known: Image | None
    ) -> None:
        """Learn the background of ghosts at once."""
        ghosts = self._ghosts.update(picture, self.background, marked, known, stamp_ns)
        if ghosts is not None:
            self.background.learn_at_once(picture, ghosts)
            if self._initial is not None:
                self._initial.replace(picture, ghosts)

    def _start(self, picture: Image, stamp_ns: int) -> None:
        self.reset()
        self._started_ns = stamp_ns
        self._initial = InitialBackground(picture, stamp_ns)
        self.background.start(picture, stamp_ns)

    def _learn_initial(self, picture: Image, stamp_ns: int, known: Image | None) -> None:
        """Replace the background by an estimate from the first seconds, when one is due."""
        if self._initial is None:
            return
        found = self._initial.update(picture, stamp_ns, known, self.background.picture())
        if found is not None:
            self.background.replace(found)
        if self._initial.over:
            self._initial = None

    def _adapt(
        self, picture: Image, stamp_ns: int, marked: Image, known: Image | None
    ) -> tuple[Image, bool]:
        """Fit the background to a picture of which a large part differs from it.

        Less light makes all of the picture a shadow, so shadows count as different here.
        """
        if self._differs_ns is None:
            self._differs_ns = stamp_ns
        before, mask = self.background.picture(), _cleaned(marked)
        if same_texture(before, picture, marked) > SAME_TEXTURE:
            self.background.replace(relit(before, picture, known))
            adapted = self.background.foreground(picture)
            if cv2.countNonZero(adapted) < RELIT_SHARE * cv2.countNonZero(marked):
                self._differs_ns = None
                self._dynamic.forget_colours()
                self._initial = None
                return _cleaned(adapted), self._is_new(stamp_ns)
            self.background.replace(before)
        if (stamp_ns - self._differs_ns) / 1e9 >= MOVED_S and (
            cv2.countNonZero(mask) > 2 * CHANGED_SHARE * mask.size
        ):
            self._start(picture, stamp_ns)
            return np.zeros_like(mask), True
        return mask, False

    def _is_new(self, stamp_ns: int) -> bool:
        """Return whether a change of the light is a new one, not a continued one."""
        before, self._relit_ns = self._relit_ns, stamp_ns
        return before is None or not 0 <= stamp_ns - before < SAME_CHANGE_S * 1e9


def _cleaned(marked: Image) -> Image:
    """Return the foreground without shadows and single pixels."""
    _, mask = cv2.threshold(marked, SHADOW, 255, cv2.THRESH_BINARY)
    return np.asarray(cv2.medianBlur(mask, 3), np.uint8)


def _boxes_mask(boxes: Sequence[Fragment], size: tuple[int, int]) -> Image | None:
    if not boxes:
        return None
    mask = np.zeros(size, np.uint8)
    for box in boxes:
        margin = max(LEAST_MARGIN, MARGIN * max(box.width, box.height))
        rows = slice(max(0, round(box.top - margin)), max(0, round(box.bottom + margin)))
        mask[rows, max(0, round(box.left - margin)) : max(0, round(box.right + margin))] = 255
    return mask
