"""Draws a conveyor belt under perspective and lens distortion, with the exact place of each object.

The belt runs along +X of a plane in millimetres; X = 0 and Y = 0 at one corner of the part that
the camera is aimed at, Y across the belt away from the camera. The objects lie flat on the plane,
so that a pixel and a position on the belt correspond exactly.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np
from numpy.typing import NDArray

from tests.support.pictures.belt_objects import lay_out
from zenoh_vision.calibration.camera_model import CameraModel
from zv.camera.synthetic.noise import SensorNoise

Pixels = NDArray[np.uint8]
Points = NDArray[np.float64]
"""(n, 2) float64: x, y in pixels, the centre of the top left pixel being 0, 0; or X, Y in mm."""

STRIP_SCALE = 1.25  # pixels of the drawn strip to a mm, about those of the picture
SUBPIXEL_BITS = 4
BELT_GREY = 62.0
RAIL_MM = 15.0
LEAD_S = 2.0  # the belt is empty at first, so that a tracker sees the background


@dataclass(frozen=True)
class Position:
    """Where an object is at a time: X, Y of its centre on the belt, mm, and its velocity."""

    id: int
    x_mm: float
    y_mm: float
    vx_mm_s: float


class Belt:
    """A belt with objects that pass under a camera once.

    The picture at a time depends only on these arguments and the time (the noise on the number
    of the frame); frames can be drawn in any order.

    Args:
        width: Of the picture, pixels.
        height: Of the picture, pixels.
        number: Of objects; a third of them lie in touching pairs (10 of 30).
        speed_mm_s: Of the belt, along +X.
        rate_hz: Of the frames.
        seed: Determines the objects and the texture.
        noise: Standard deviation of the sensor noise, grey levels.
        distortion: k1, k2, p1, p2, k3 of the lens; zeros for a pinhole.
        start_ns: Stamp of frame 0, ns since 1970.
    """

    length_mm = 800.0
    width_mm = 400.0
    """The part of the plane that the camera is aimed at; pictures show a little more."""

    def __init__(
        self,
        width: int = 640,
        height: int = 480,
        *,
        number: int = 30,
        speed_mm_s: float = 150.0,
        rate_hz: float = 30.0,
        seed: int = 1,
        noise: float = 2.0,
        distortion: tuple[float, float, float, float, float] = (0.0, 0.0, 0.0, 0.0, 0.0),
        start_ns: int = 1_700_000_000_000_000_000,
    ) -> None:
        self.width, self.height = width, height
        self.speed_mm_s, self.rate_hz, self.start_ns = speed_mm_s, rate_hz, start_ns
        focal = 0.9 * width
        middle = ((width - 1) / 2, (height - 1) / 2)
        k = np.array([[focal, 0, middle[0]], [0, focal, middle[1]], [0, 0, 1]])
        self.lens = CameraModel(width, height, tuple(k.ravel().tolist()), "plumb_bob", distortion)
        self._seed = seed
        self.objects = lay_out(number, self.width_mm, -LEAD_S * speed_mm_s, seed)
        self._noise = SensorNoise(width, height, noise, (seed, 1))

    @cached_property
    def plane(self) -> NDArray[np.float64]:
        """The 3x3 homography from undistorted pixels to X, Y in mm, exact."""
        share = [[0.06, 0.84], [0.97, 0.90], [0.79, 0.20], [0.15, 0.17]]
        size = np.array([self.width - 1, self.height - 1])
        pixels = np.array(share, np.float32) * size.astype(np.float32)
        length, across = self.length_mm, self.width_mm
        corners = np.array([[0, 0], [length, 0], [length, across], [0, across]], np.float32)
        return np.asarray(cv2.getPerspectiveTransform(pixels, corners), np.float64)

    @property
    def duration_s(self) -> float:
        """Until the last object has left the part of the plane, and its border."""
        last = min(one.along_mm for one in self.objects)
        return (1.25 * self.length_mm - last) / self.speed_mm_s

    @property
    def frames(self) -> int:
        """Number of frames in ``duration_s``."""
        return int(self.duration_s * self.rate_hz) + 1

    def time_s(self, index: int) -> float:
        """Return the time of a frame in the belt's time, from 0."""
        return (self.stamp_ns(index) - self.start_ns) / 1e9

    def stamp_ns(self, index: int) -> int:
        """Return the capture stamp of a frame."""
        return self.start_ns + round(index * 1e9 / self.rate_hz)

    def picture(self, index: int) -> Pixels:
        """Return frame ``index``, (height, width, 3) uint8 BGR, a new array."""
        bgr = self.picture_at(self.time_s(index))
        self._noise.add(index, bgr)
        return bgr

    def picture_at(self, time_s: float) -> Pixels:
        """Return the picture at a time, without noise."""
        columns, rows, on_belt = self._grid
        moved = columns - np.float32(self.speed_mm_s * time_s * STRIP_SCALE)
        belt = cv2.remap(
            self._strip, moved, rows, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE
        )
        mixed = belt * on_belt + self._surroundings * (1 - on_belt)
        return np.rint(mixed).astype(np.uint8)

    def positions(self, time_s: float) -> list[Position]:
        """Return where each object is, on the part that the camera is aimed at or not."""
        return [
            Position(one.id, one.along_mm + self.speed_mm_s * time_s, one.y_mm, self.speed_mm_s)
            for one in self.objects
        ]

    def crossing_s(self, object_id: int, x_mm: float) -> float:
        """Return the time at which the centre of an object crosses the line X = ``x_mm``."""
        return (x_mm - self.objects[object_id - 1].along_mm) / self.speed_mm_s

    def to_mm(self, pixels: Points) -> Points:
        """Return the places on the plane, (n, 2) mm, of pixels of the distorted picture."""
        return transformed(self.plane, self.lens.undistorted(np.asarray(pixels, np.float64)))

    def to_pixels(self, mm: Points) -> Points:
        """Return the pixels of the distorted picture, (n, 2), that show places on the plane."""
        inverse = np.linalg.inv(self.plane)
        return self.lens.distorted(transformed(inverse, np.asarray(mm, np.float64)))

    def outline(self, object_id: int, time_s: float) -> Points:
        """Return the outline of an object in the distorted picture, (n, 2) pixels."""
        one = self.objects[object_id - 1]
        centre = np.array([one.along_mm + self.speed_mm_s * time_s, one.y_mm])
        return self.to_pixels(one.outline_mm + centre)

    def boxes(self, time_s: float) -> dict[int, tuple[float, float, float, float]]:
        """Return x, y, width, height in pixels of the objects that are wholly in the picture."""
        found = {}
        for one in self.objects:
            centre = one.along_mm + self.speed_mm_s * time_s
            if not -0.3 * self.length_mm < centre < 1.3 * self.length_mm:
                continue  # far outside, where the distortion means nothing
            points = self.outline(one.id, time_s)
            (left, top), (right, bottom) = points.min(axis=0), points.max(axis=0)
            if left >= 0 and top >= 0 and right <= self.width - 1 and bottom <= self.height - 1:
                found[one.id] = (left, top, right - left, bottom - top)
        return found

    @cached_property
    def _grid(self) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.float32]]:
        """Return column and row in the strip of each pixel, and its share on the belt."""
        y, x = np.mgrid[: self.height, : self.width]
        mm = self.to_mm(np.stack([x.ravel(), y.ravel()], 1))
        along = mm[:, 0].reshape(x.shape)
        across = mm[:, 1].reshape(x.shape)
        inside = np.minimum(across + RAIL_MM, self.width_mm + RAIL_MM - across) * STRIP_SCALE
        share = np.clip(inside + 0.5, 0, 1)[:, :, None].astype(np.float32)
        columns = (along - self._strip_begin_mm) * STRIP_SCALE
        rows = (across + RAIL_MM) * STRIP_SCALE
        return columns.astype(np.float32), rows.astype(np.float32), share

    @property
    def _strip_begin_mm(self) -> float:
        return -self.speed_mm_s * self.duration_s - self.length_mm

    @cached_property
    def _strip(self) -> Pixels:
        """Return the whole belt with its objects, seen from above at time 0."""
        columns = round((2 * self.length_mm - self._strip_begin_mm) * STRIP_SCALE)
        rows = round((self.width_mm + 2 * RAIL_MM) * STRIP_SCALE)
        rng = np.random.default_rng((self._seed, 2))
        strip = textured(rng, columns, rows, np.array([BELT_GREY] * 3), 1.5, 4)
        for one in self.objects:
            origin = np.array([one.along_mm - self._strip_begin_mm, one.y_mm + RAIL_MM])
            low, high = one.outline_mm.min(axis=0), one.outline_mm.max(axis=0)
            first = np.floor((origin + low) * STRIP_SCALE).astype(int) - 2
            size = np.ceil((high - low) * STRIP_SCALE).astype(int) + 5
            window = np.s_[first[1] : first[1] + size[1], first[0] : first[0] + size[0]]
            surface = textured(rng, int(size[0]), int(size[1]), np.array(one.colour), 9.0, 3)
            centre = origin * STRIP_SCALE - first
            for scale, gain in ((1.0, 1.0), (0.45, 0.75)):  # the inner part is a label
                share = drawn(one.outline_mm * scale * STRIP_SCALE + centre, size)
                mixed = strip[window] * (1 - share) + surface * gain * share
                strip[window] = np.clip(np.rint(mixed), 0, 255).astype(np.uint8)
        return strip

    @cached_property
    def _surroundings(self) -> NDArray[np.float32]:
        rng = np.random.default_rng((self._seed, 3))
        grey = np.array([132.0, 140.0, 146.0])
        return textured(rng, self.width, self.height, grey, 6.0, 12).astype(np.float32)


def transformed(homography: NDArray[np.float64], points: Points) -> Points:
    """Return points, (n, 2), under a 3x3 homography."""
    mapped = np.column_stack([points, np.ones(len(points))]) @ homography.T
    return np.asarray(mapped[:, :2] / mapped[:, 2:])


def textured(
    rng: np.random.Generator,
    width: int,
    height: int,
    colour: NDArray[np.float64],
    sigma: float,
    grain: int,
) -> Pixels:
    """Return a surface of a colour with blotches of about ``grain`` pixels, (h, w, 3) uint8."""
    coarse = rng.standard_normal((-(-height // grain), -(-width // grain)), np.float32)
    blotches = np.asarray(cv2.resize(coarse, (width, height)), np.float32) * np.float32(sigma)
    return np.clip(np.rint(blotches[:, :, None] + colour), 0, 255).astype(np.uint8)


def drawn(polygon: Points, size: NDArray[np.int_]) -> NDArray[np.float32]:
    """Return the share of each pixel inside a polygon, (height, width, 1), 0 to 1."""
    mask = np.zeros((int(size[1]), int(size[0])), np.uint8)
    points = np.rint(polygon * (1 << SUBPIXEL_BITS)).astype(np.int32)
    cv2.fillPoly(mask, [points], 255, cv2.LINE_AA, SUBPIXEL_BITS)
    return (mask.astype(np.float32) / 255)[:, :, None]
