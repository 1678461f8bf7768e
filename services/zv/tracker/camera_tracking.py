"""Tracks the objects of one camera: runs the pipeline on its frames and publishes the results."""

from __future__ import annotations

import logging
import math
from collections.abc import Sequence
from dataclasses import fields, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from zenoh_vision import Centroid, Frame, Node
from zenoh_vision.messages import Header, Tracks
from zenoh_vision.messages import Track as TrackMessage
from zv.tracker import shapes
from zv.tracker.camera_world import CameraWorld
from zv.tracker.drawing import Trails, draw_tracks
from zv.tracker.event_publisher import EventPublisher, tracks_end
from zv.tracker.foreground.foreground import ForegroundParameters
from zv.tracker.pipelines.largest import LargestObject, LargestObjectParameters, MovingObject, draw
from zv.tracker.pipelines.robust import RobustParameters, RobustTracker, enlarged, working_scale
from zv.tracker.settings import TrackerSettings
from zv.tracker.tracking.track import Track
from zv.tracker.tracking.tracker import TrackingParameters

log = logging.getLogger(__name__)

Pixels = NDArray[np.uint8]


class CameraTracking:
    """Tracks the objects of one camera and publishes the results.

    The background is learned anew for a new epoch, size, pipeline or range of depth, and when the
    camera's clock was set back; a change of another setting keeps it. Ids start again from 1 in
    each epoch.

    Args:
        node: Publishes the results.
        camera: The camera's name.
        settings: The initial settings.
    """

    def __init__(self, node: Node, camera: str, settings: TrackerSettings) -> None:
        self._node = node
        self._settings: TrackerSettings | None = None
        self._reset = settings.reset
        self._stream: tuple[object, ...] = ()
        self._header: Header | None = None
        self._next_id = 1
        self._largest = LargestObject(largest_parameters(settings))
        self._robust = RobustTracker(robust_parameters(settings))
        self._trails = Trails()
        self._events = EventPublisher(node, settings)
        self._world = CameraWorld(node, camera)

    def process(self, frame: Frame, picture: Pixels) -> None:
        """Track the objects in a frame and publish the results.

        Args:
            frame: The next frame of the camera.
            picture: Its pixels, as returned by ``decoded``.
        """
        settings: TrackerSettings = frame.revision.settings
        self._apply(frame, settings)
        if settings.pipeline == "tutorial":
            self._largest_object(frame, picture, settings)
        else:
            self._all_objects(frame, picture, settings)

    def _apply(self, frame: Frame, settings: TrackerSettings) -> None:
        """Apply the settings of a frame; reset the tracking if the frame does not continue it."""
        header, before = frame.header, self._header
        self._header = header
        if before is None or header.epoch != before.epoch:
            self._next_id = 1
        restarts = before is None or tracks_end(before, header)
        stream = (
            (header.width, header.height),
            settings.pipeline,
            frame.value_range,
        )
        if restarts or stream != self._stream:
            self._stream = stream
            self._largest = LargestObject(largest_parameters(settings))
            self._robust = RobustTracker(robust_parameters(settings), self._next_id)
            self._trails = Trails()
        elif settings is not self._settings:
            self._largest.adjust(largest_parameters(settings))
            self._robust.adjust(robust_parameters(settings))
            if settings.reset != self._reset:
                self._robust.reset()
        self._reset = settings.reset
        self._settings = settings

    def _largest_object(self, frame: Frame, bgr: Pixels, settings: TrackerSettings) -> None:
        """Process a frame with the tutorial's pipeline; it has no ids, so ``tracks`` is empty."""
        node = self._node
        found, mask = self._largest.update(bgr)
        node.publish("centroid", centroid_of(node, frame, found))
        self._publish_tracks(frame, (), settings)
        drawn = partial(draw, bgr, found)
        node.publish_picture("tracked/compressed", frame, drawn, quality=settings.quality)
        node.publish_picture("mask/compressed", frame, mask, encoding="mono8", bilevel=True)

    def _all_objects(self, frame: Frame, picture: Pixels, settings: TrackerSettings) -> None:
        node, robust = self._node, self._robust
        size = frame.header.width, frame.header.height
        tracks = robust.update(picture, frame.header.stamp_ns, size)
        self._next_id = robust.next_id
        self._trails.update(tracks, frame.header.stamp_ns)
        if robust.scene_changed:
            node.counters.note("scene_changes")
            log.warning(
                "%s: the light or the view of the whole scene changed; the background follows it",
                frame.header.camera,
            )
        main = robust.centroid
        found = None if main is None else MovingObject(main.box, main.area)
        node.publish("centroid", centroid_of(node, frame, found))
        self._publish_tracks(frame, tracks, settings)
        trails = self._trails.lines()
        node.publish_picture(
            "tracked/compressed",
            frame,
            lambda: draw_tracks(frame.bgr, tracks, trails),
            quality=settings.quality,
        )
        node.publish_picture(
            "mask/compressed",
            frame,
            partial(enlarged, robust.mask, size),
            encoding="mono8",
            bilevel=True,
        )
        node.publish_picture(
            "background/compressed", frame, robust.background, quality=settings.quality
        )

    def _publish_tracks(
        self, frame: Frame, tracks: Sequence[Track], settings: TrackerSettings
    ) -> None:
        plane, found = self._world.update(frame, tracks, settings.anchor)
        zones, lines = self._events.update(frame, tracks, settings, plane)
        self._node.publish(
            "tracks",
            Tracks(
                header=self._node.header(frame),
                tracks=tuple(map(track_message, tracks, found)),
                zones=zones,
                lines=lines,
            ),
        )


def decoded(frame: Frame, settings: TrackerSettings) -> Pixels:
    """Return the pixels that the pipeline needs: BGR, for ``robust`` of a reduced size.

    Raises:
        PayloadError: ``corrupt``, if the picture cannot be decoded.
    """
    if settings.pipeline == "tutorial":
        return frame.bgr
    width, height = frame.header.width, frame.header.height
    scale = working_scale(width, height)
    return np.asarray(frame.reduced("bgr8", -(-width // scale), -(-height // scale)), np.uint8)


def largest_parameters(settings: TrackerSettings) -> LargestObjectParameters:
    """Return the tutorial's parameters from the settings of the same names."""
    names = [field.name for field in fields(LargestObjectParameters)]
    return LargestObjectParameters(**{name: getattr(settings, name) for name in names})


def robust_parameters(settings: TrackerSettings) -> RobustParameters:
    """Return the parameters of the pipeline ``robust`` from the settings."""
    foreground = ForegroundParameters(
        subtractor=settings.subtractor,
        var_threshold=settings.var_threshold,
        detect_shadows=settings.detect_shadows,
        learning_s=settings.learning_time,
        frozen=settings.freeze,
        regions=tuple(each.points for each in shapes.polygons(settings.regions)),
        ignored=tuple(each.points for each in shapes.polygons(settings.ignore)),
    )
    return RobustParameters(
        foreground=foreground,
        tracking=replace(TrackingParameters(), keep_lost_s=settings.keep_lost),
        min_area=settings.min_area,
        max_area=settings.max_area or math.inf,
        convex=settings.convex,
    )


def centroid_of(node: Node, frame: Frame, found: MovingObject | None) -> Centroid:
    """Return the ``Centroid`` message of a frame; its fields are None without an object."""
    header = node.header(frame)
    if found is None:
        return Centroid(header=header, x=None, y=None, box=None, area=None)
    x, y = found.center
    return Centroid(header=header, x=x, y=y, box=found.box, area=found.area)


def track_message(track: Track, world: tuple[float, float] | None = None) -> TrackMessage:
    """Return the message of a track, with its position in the world if that is known."""
    return TrackMessage(
        id=track.id,
        state=track.state,
        x=track.x,
        y=track.y,
        box=track.box,
        area=track.area,
        vx=track.vx,
        vy=track.vy,
        age_s=track.age_s,
        missing_s=track.missing_s,
        world=world,
    )
