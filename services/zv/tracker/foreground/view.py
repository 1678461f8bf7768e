"""Judges whether a picture still shows the scene of the background, in any light."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, Literal

import cv2
import numpy as np
from numpy.typing import NDArray

from zv.tracker.foreground.steadying import reduced

Image = NDArray[np.uint8]
Floats = NDArray[np.float32]

Shown = Literal["scene", "nothing", "other"]
"""The scene; nothing, since the picture is black or the lens is covered; or another view."""


EDGE: Final = 16.0
"""Least gradient of an edge by Sobel's operator: 2 grey levels a pixel."""

STRONGEST: Final = 2.0
"""Edges count up to this multiple of the mean: a lamp at night is no more than another edge."""


@dataclass(frozen=True, slots=True)
class ViewLimits:
    """The constants of changes of the view."""

    # The picture shows something else if its edges agree with those of the background by less than
    # this share of the usual agreement,
    other: float = 0.3
    least: float = 0.3  # where that is at least this
    # A scene is judged if edges are in this share of it: before a plain wall, those of an object
    # would be most of them.
    busy: float = 0.2
    # It then shows nothing if its edges have less than this share of the power of the
    # background's.
    plain: float = 0.25
    usual_s: float = 10.0  # time over which the usual agreement is averaged, seconds


class View:
    """Compares the edges of pictures with those of the background.

    Light changes the strength of edges, but neither their places nor their directions.
    """

    def __init__(self, limits: ViewLimits) -> None:
        self._limits = limits
        self._usual = self._age_s = 0.0
        self._known: Image | None = None
        self._edges: tuple[Floats, Floats, float] | None = None

    def shown(
        self, background: Image, small: Image, hidden: Image | None, elapsed_s: float
    ) -> Shown:
        """Return what a picture shows.

        Args:
            background: (height, width, 3) uint8 BGR; its edges are computed anew for another array.
            small: The picture, ``reduced``.
            hidden: (height, width) uint8, not 0 where known objects hide the background.
            elapsed_s: Time since the last picture, seconds.
        """
        limits = self._limits
        if self._edges is None or background is not self._known:
            self._known, self._edges = background, _edges(reduced(background))
        (x, y, busy), (seen_x, seen_y, _) = self._edges, _edges(small)
        if hidden is not None:
            free = cv2.resize(
                cv2.bitwise_not(hidden), x.shape[1::-1], interpolation=cv2.INTER_NEAREST
            )
            x, y, seen_x, seen_y = (
                np.asarray(cv2.bitwise_and(each, each, mask=free), np.float32)
                for each in (x, y, seen_x, seen_y)
            )
        power = float(np.vdot(x, x) + np.vdot(y, y))
        seen_power = float(np.vdot(seen_x, seen_x) + np.vdot(seen_y, seen_y))
        common = float(np.vdot(x, seen_x) + np.vdot(y, seen_y))
        agreement = common / max((power * seen_power) ** 0.5, 1.0)
        judged = busy >= limits.busy and self._usual >= limits.least
        if judged and agreement < limits.other * self._usual:
            return "nothing" if seen_power < limits.plain * power else "other"
        self._age_s = min(limits.usual_s, self._age_s + elapsed_s)
        self._usual += (agreement - self._usual) * min(1.0, elapsed_s / max(self._age_s, 1e-9))
        return "scene"


def _edges(small: Image) -> tuple[Floats, Floats, float]:
    """Return the gradients of a reduced picture along x and y, and the share of it with edges."""
    x, y = (cv2.Sobel(small, cv2.CV_32F, dx, 1 - dx) for dx in (1, 0))
    strength = np.abs(x) + np.abs(y)
    most = STRONGEST / 2 * float(strength.mean())
    return np.clip(x, -most, most), np.clip(y, -most, most), float((strength > EDGE).mean())
