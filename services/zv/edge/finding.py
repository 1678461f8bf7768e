"""Finds the edges of one frame: map, strength, steps and lines, each computed on demand."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import cached_property, partial
from typing import Any

import numpy as np

from zenoh_vision.image.frame import Frame
from zenoh_vision.messages import Contour, Contours, Header
from zv.edge.contours import LineLimits, Lines, trace
from zv.edge.detectors.available import DETECTORS, detector_named
from zv.edge.detectors.detection import STAGES, Detection, Detector
from zv.edge.detectors.rendering import Gray, Picture, Strength
from zv.edge.selection import SelectedPart, corners, selected
from zv.edge.settings import EdgeSettings


class EdgesOfFrame:
    """The edges of one frame; all results have the frame's size, also with a region or a scale.

    Nothing is computed, and no raw pixels are converted, before a result is requested.

    Args:
        frame: The frame; it must own its bytes, since its steps may be computed later.
        settings: The detector, its parameters, region and scale.
        mask: The image of the setting ``mask``, (height, width) uint8; None without a mask.

    Raises:
        PayloadError: ``region_outside``: the frame has no pixel of the region; ``corrupt``: it
            cannot be decoded.
    """

    def __init__(self, frame: Frame, settings: EdgeSettings, mask: Gray | None = None) -> None:
        self._settings = settings
        self._mask = mask
        corners(settings.box, frame.header.height, frame.header.width)
        self._frame = frame
        decode_ahead(frame, settings)

    @cached_property
    def _detector(self) -> Detector:
        return detector_named(self._settings.detector, self._settings)

    @cached_property
    def _part(self) -> SelectedPart:
        picture = np.asarray(self._frame.view(self._detector.wants), np.uint8)
        return selected(picture, self._settings.box, self._settings.scale, self._mask)

    @cached_property
    def _detection(self) -> Detection[Any]:
        return self._detector.detect(self._part.picture)

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
        """The strength that is encoded as 65535 in 16 bits."""
        return self._detector.full_scale

    @property
    def stages(self) -> Mapping[str, Callable[[], Picture]]:
        """The detector's steps as pictures of the frame's size, each made when it is called."""
        return {name: partial(self._stage, name) for name in STAGES}

    def _stage(self, name: str) -> Picture:
        return self._part.whole(self._detection.stages[name]())

    @cached_property
    def lines(self) -> Lines:
        """The lines of the edge map, in pixels of the frame."""
        settings = self._settings
        pixel = float(self._part.factor.mean())  # lines are traced at the reduced scale
        limits = LineLimits(
            max_count=settings.contours,
            min_length=settings.contour_min / pixel,
            tolerance=settings.contour_tolerance / pixel,
            circles=settings.circles,
        )
        return self._part.in_frame(trace(self._edges_of_part, limits))

    @property
    def density(self) -> float:
        """The share of edge pixels in the selected part of the frame."""
        return float(np.count_nonzero(self._edges_of_part) / self._edges_of_part.size)

    def message(self, make_header: Callable[[], Header]) -> Contours:
        """Return the message with the lines; its header is made after they are traced."""
        lines, density = self.lines, self.density
        circles = lines.circles
        return Contours(
            header=make_header(),
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
            circles=None if circles is None else tuple(map(tuple, circles.tolist())),
        )


def decode_ahead(frame: Frame, settings: EdgeSettings) -> None:
    """Decode a frame before a result is requested, if it may be corrupt.

    Raw pixels are converted only for a result.

    Raises:
        PayloadError: ``corrupt``: the frame cannot be decoded.
    """
    if frame.picture.form is not None:
        frame.view(DETECTORS[settings.detector].wants)
