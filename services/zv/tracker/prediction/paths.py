"""Keeps the paths of a camera's objects over the last seconds, and predicts their positions."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from zenoh_vision.calibration.plane_view import PlaneView, pair
from zv.tracker.events.sighting import HALF_PIXEL, Anchor, anchor_of
from zv.tracker.prediction.forecast import KEPT_S, TooShort, forecast
from zv.tracker.tracking.track import Track

Point = tuple[float, float]
Floats = NDArray[np.float64]

NOISE_PX = 0.3
"""Least standard deviation of a position, pixels: that of a mean of many edge pixels."""

KEPT = 128
"""Largest number of positions kept of an object: 4 s at 30 Hz."""


@dataclass(frozen=True)
class Predicted:
    """The predicted state of an object, with the fields of the message ``Prediction``."""

    x: float
    y: float
    vx: float
    vy: float
    sigma: Point
    world: Point | None = None
    world_velocity: Point | None = None
    world_sigma: Point | None = None


@dataclass(slots=True)
class Path:
    """The path of one object."""

    track: Track  # its track in the newest frame
    # Stamp, ``Track.steady`` and the smoothed centre of each frame in which it was measured.
    seen: deque[tuple[int, Point, Point]] = field(default_factory=lambda: deque(maxlen=KEPT))
    # Its centre in the newest of these frames, (2,), pixels.
    center: Floats = field(default_factory=lambda: np.zeros(2))
    # Its anchor in the newest of these frames, (2,), pixels.
    anchor: Floats = field(default_factory=lambda: np.zeros(2))


class Paths:
    """The paths of all objects of one camera in one epoch.

    Args:
        anchor: The point of an object whose world position is wanted.
    """

    def __init__(self, anchor: Anchor) -> None:
        self.anchor: Anchor = anchor
        self._paths: dict[int, Path] = {}

    @property
    def ids(self) -> list[int]:
        """The ids of the current tracks, ascending."""
        return sorted(self._paths)

    def update(self, tracks: Sequence[Track], stamp_ns: int) -> None:
        """Process all tracks of the next frame; tracks that are missing have ended."""
        former = self._paths
        self._paths = {}
        for track in tracks:
            path = former.get(track.id) or Path(track)
            path.track = track
            if path.seen and stamp_ns < path.seen[-1][0]:  # the camera's clock was set back
                path.seen.clear()
            if track.steady is not None and (not path.seen or stamp_ns > path.seen[-1][0]):
                path.seen.append((stamp_ns, track.steady, (track.x, track.y)))
                path.center = np.add(track.steady, track.offset)
                x, y = path.center.tolist()
                path.anchor = np.array(anchor_of(replace(track, x=x, y=y), self.anchor))
            self._paths[track.id] = path

    def trails(self, stamp_ns: int) -> dict[int, list[Point]]:
        """Return the centres of each object in the seconds before a stamp, oldest first, by id."""
        since_ns = stamp_ns - KEPT_S * 1e9
        return {
            id_: [center for at_ns, _, center in path.seen if at_ns >= since_ns]
            for id_, path in self._paths.items()
        }

    def track(self, id_: int) -> Track | None:
        """Return a track of the newest frame; None if there is none with this id."""
        path = self._paths.get(id_)
        return None if path is None else path.track

    def predict(self, id_: int, at_ns: int, view: PlaneView | None) -> Predicted:
        """Predict the position of an object.

        With a plane, the object is assumed to move in a straight line on it, as on a belt; without
        one, in the picture.

        Args:
            id_: Id of a current track.
            at_ns: Time of the prediction, by the clock of the stamps.
            view: The mapping to the plane; None without one.

        Raises:
            TooShort: The object was seen in too few frames.
        """
        path = self._paths[id_]
        recent = [each for each in path.seen if each[0] >= path.seen[-1][0] - KEPT_S * 1e9]
        if not recent:
            raise TooShort("seen in 0 frames")
        origin_ns = recent[0][0]
        times_s = np.array([(stamp_ns - origin_ns) / 1e9 for stamp_ns, _, _ in recent])
        moved = np.array([point for _, point, _ in recent]) - recent[-1][1]
        at_s = (at_ns - origin_ns) / 1e9
        if view is not None:
            last = path.anchor - HALF_PIXEL
            places = view.positions(last + moved)
            if np.isfinite(places).all():
                found = _on_plane(times_s, places, at_s, view, last, path.center - last)
                if found is not None:
                    return _with_perspective(found, path, view)
        flat = forecast(times_s, path.center + moved, at_s, np.full(2, NOISE_PX))
        (x, y), (vx, vy) = flat.position.tolist(), flat.velocity.tolist()
        return Predicted(x, y, vx, vy, _two(flat.sigma))


def _on_plane(
    times_s: Floats, places: Floats, at_s: float, view: PlaneView, last: Floats, offset: Floats
) -> Predicted | None:
    """Predict on the plane; None if the path reaches the plane's horizon."""
    here = view.jacobian(*last.tolist())
    if here is None:
        return None
    there = forecast(times_s, places, at_s, NOISE_PX * np.linalg.norm(here, axis=1))
    anchor = view.pixels(there.position[None])[0]
    if not np.isfinite(anchor).all():
        return None
    jacobian = view.jacobian(*anchor.tolist())
    if jacobian is None or abs(np.linalg.det(jacobian)) == 0:
        return None
    inverse = np.linalg.inv(jacobian)
    covariance = inverse @ np.diag(there.sigma**2) @ inverse.T
    (x, y), (vx, vy) = (anchor + offset).tolist(), (inverse @ there.velocity).tolist()
    world = pair(there.position), pair(there.velocity), pair(there.sigma)
    return Predicted(x, y, vx, vy, _two(np.sqrt(np.diag(covariance))), *world)


def _with_perspective(found: Predicted, path: Path, view: PlaneView) -> Predicted:
    """Return a prediction whose deviation on the plane includes that of the centre of the box.

    Perspective shows the nearer half of a flat object larger, so the centre of its box is off the
    centre of the object. Along each axis of the picture, the error is the distance on the plane
    between the centre of the box and the midpoint of its two opposite edges; both are added.
    """
    if found.world_sigma is None or not np.array_equal(path.anchor, path.center):
        return found
    _, _, width, height = path.track.box
    to_edges = np.array([(0, 0), (width, 0), (-width, 0), (0, height), (0, -height)]) / 2
    center, *edges = view.positions(path.center - HALF_PIXEL + to_edges)
    off = np.sum(edges, axis=0) / 2 - 2 * center
    if not np.isfinite(off).all():
        return found
    return replace(found, world_sigma=_two(np.hypot(found.world_sigma, off)))


def _two(numbers: Floats) -> Point:
    return float(numbers[0]), float(numbers[1])
