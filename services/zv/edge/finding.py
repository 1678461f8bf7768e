"""The edges of one frame by the settings: map, strength, steps and lines, each made on demand."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import cached_property, partial

import numpy as np

from zenoh_vision.image.frame import Form, Frame
from zenoh_vision.messages import Contour, Contours, Header
from zv.edge.contours import LineLimits, Lines, trace
from zv.edge.detectors.available import DETECTORS, detector_named
from zv.edge.detectors.detection import Detector, Gray, Picture, Strength
from zv.edge.selection import Selection
from zv.edge.settings import EdgeSettings


class EdgesOfFrame:
    """Edges of one frame; results are of the frame's size, whatever part was looked at.

    Args:
        frame: Not borrowed: steps may be computed later.
        settings: Detector, its parameters, region, scale.
        mask: Image of the setting ``mask``.

    Raises:
        PayloadError: ``region_outside``.
    """

    def __init__(self, frame: Frame, settings: EdgeSettings, mask: Gray | None = None) -> None:
        self._settings = settings
        self._detector: Detector = detector_named(settings.detector, settings)
        picture = frame.bgr if self._detector.wants == "bgr" else frame.gray
        self._part = Selection(settings.box, settings.scale, mask).of(picture)
        self._detection = self._detector.detect(self._part.picture)

    @cached_property
    def _edges_of_part(self) -> Gray:
        return self._part.masked(self._detection.edges)

    @property
    def edges(self) -> Gray:
        """The edge map, (height, width) uint8, 0 or 255."""
        return self._part.whole(self._edges_of_part)

    @property
    def strength(self) -> Strength:
        """Strength after thinning and before any threshold, (height, width) float32."""
        return self._part.whole(self._part.masked(self._detection.strength))

    @property
    def full_scale(self) -> float:
        """The strength that becomes 65535 in 16 bits."""
        return self._detector.full_scale

    @property
    def stages(self) -> Mapping[str, Callable[[], Picture]]:
        """The detector's steps as pictures of the frame's size, each made when it is called."""
        return {
            name: partial(self._whole_stage, make) for name, make in self._detection.stages.items()
        }

    def _whole_stage(self, make: Callable[[], Picture]) -> Picture:
        return self._part.whole(make())

    @cached_property
    def lines(self) -> Lines:
        """The lines of the edge map, in pixels of the frame."""
        settings = self._settings
        pixel = float(self._part.factor.mean())  # lines are traced at the reduced scale
        limits = LineLimits(
            most=settings.contours,
            shortest=settings.contour_min / pixel,
            tolerance=settings.contour_tolerance / pixel,
            circles=settings.circles,
        )
        return self._part.in_frame(trace(self._edges_of_part, limits))

    @property
    def density(self) -> float:
        """The share of the pixels looked at that are edges."""
        return float(np.count_nonzero(self._edges_of_part) / self._edges_of_part.size)


def message_of(lines: Lines, density: float, header: Header) -> Contours:
    """Return the message with the lines of a frame."""
    return Contours(
        header=header,
        density=density,
        contours=tuple(
            Contour(
                points=tuple(map(tuple, line.points.tolist())),
                length=line.length,
                closed=line.closed,
            )
            for line in lines.polylines
        ),
        omitted=lines.omitted,
        segments=tuple(map(tuple, lines.segments.tolist())),
        circles=None if lines.circles is None else tuple(map(tuple, lines.circles.tolist())),
    )


def wanted_form(settings: EdgeSettings) -> Form:
    """Return the form of frames that the detector takes."""
    return DETECTORS[settings.detector].wants
