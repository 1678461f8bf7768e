"""Tracks the objects of one camera: runs the pipeline on its frames and publishes the results."""

from __future__ import annotations

import logging
import math
import time
from collections.abc import Sequence
from dataclasses import fields
from functools import lru_cache, partial
from typing import Final

import numpy as np
from numpy.typing import NDArray

from zenoh_vision import Centroid, Frame, Node
from zenoh_vision.calibration.calibration import Calibration
from zenoh_vision.calibration.camera_model import CalibrationFault
from zenoh_vision.calibration.plane_view import PlaneView
from zenoh_vision.messages import Header, Level, Tracks
from zenoh_vision.messages import Track as TrackMessage
from zenoh_vision.node.calibration_source import CalibrationSource
from zv.tracker import shapes
from zv.tracker.detector.class_names import Wanted
from zv.tracker.detector.model import Detection
from zv.tracker.detector.options import classes_of
from zv.tracker.drawing import draw_tracks
from zv.tracker.event_publisher import EventPublisher, tracks_end
from zv.tracker.events.sighting import places
from zv.tracker.foreground.foreground import ForegroundParameters
from zv.tracker.foreground.view import Shown
from zv.tracker.pipelines.base import enlarged, working_scale
from zv.tracker.pipelines.detector import DetectorParameters, DetectorTracker
from zv.tracker.pipelines.largest import LargestObject, LargestObjectParameters, MovingObject, draw
from zv.tracker.pipelines.robust import RobustParameters, RobustTracker
from zv.tracker.prediction.answers import PredictionAnswers
from zv.tracker.scene_report import SceneReport
from zv.tracker.settings import TrackerSettings
from zv.tracker.tracking.track import Track
from zv.tracker.tracking.tracker import TrackingParameters
from zv.tracker.turned_shapes import TurnedShapes

log = logging.getLogger(__name__)

EXPIRES_S: Final = 3.0
"""All tracks end when a camera has been silent for ``keep_lost`` and this time."""

OF_TRACK: Final = TrackMessage.model_fields.keys() - {"world"}

Pixels = NDArray[np.uint8]


class CameraTracking:
    """Tracks the objects of one camera and publishes the results.

    The background is learned anew for a new epoch, size, orientation, pipeline or range of depth,
    and when the camera's clock was set back; a change of another setting keeps it. Ids start again
    from 1 in each epoch.
    """

    def __init__(self, node: Node, camera: str, settings: TrackerSettings) -> None:
        self._node = node
        self._settings: TrackerSettings | None = None
        self._reset = settings.reset
        self._stream: tuple[object, ...] = ()
        self._header: Header | None = None
        self._frame_s = 0.0
        self._next_id = 1
        self._restart(settings)
        self._events = EventPublisher(node, settings)
        self._shapes = TurnedShapes(node, camera, settings)
        self._calibrations = CalibrationSource(node, camera)
        self._predictions = PredictionAnswers(node, camera)
        self._report = SceneReport()
        self._reported = ""

    def process(self, frame: Frame, picture: Pixels) -> None:
        """Track the objects in a frame and publish the results.

        Args:
            frame: The next frame of the camera.
            picture: Its pixels, as returned by ``decoded``.
        """
        settings = self._apply(frame)
        if settings.pipeline == "tutorial":
            self._largest_object(frame, picture, settings)
        else:
            size = frame.header.width, frame.header.height
            self._robust.update(picture, frame.header.stamp_ns, size)
            self._all_objects(frame, self._robust, settings)

    def begin(self, frame: Frame, picture: Pixels | None) -> bool:
        """Begin a frame of the pipeline ``detector``, and return whether the model should see it.

        Args:
            frame: The next frame of the camera; one that was begun and not finished is given up.
            picture: Its pixels, as returned by ``decoded``; None if that needs none.
        """
        self._apply(frame)
        header = frame.header
        size = header.width, header.height
        return self._detector.begin(header.stamp_ns, header.seq, size, picture)

    def finish(self, frame: Frame, found: Sequence[Detection] | None) -> None:
        """Finish the frame that was begun: publish its results."""
        self._detector.finish(found)
        self._all_objects(frame, self._detector, frame.revision.settings)

    def take_late(self, frame: Frame, found: Sequence[Detection]) -> bool:
        """Use what the model found in an earlier frame, and return whether it was of use."""
        header = self._header
        if header is None or tracks_end(frame.header, header):
            return False
        return self._detector.late(found, frame.header.stamp_ns)

    def _apply(self, frame: Frame) -> TrackerSettings:
        """Apply the settings of a frame; reset the tracking if the frame does not continue it."""
        self._frame_s = time.monotonic()
        self._shapes.follow(frame)
        settings: TrackerSettings = frame.revision.settings
        header, before = frame.header, self._header
        self._header = header
        if before is None or header.run != before.run:
            self._next_id = 1
        restarts = before is None or tracks_end(before, header)
        stream = (header.width, header.height, settings.pipeline, frame.value_range)
        if restarts or stream != self._stream:
            self._stream = stream
            self._restart(settings)
        elif settings is not self._settings:
            self._largest.adjust(largest_parameters(settings))
            self._robust.parameters = robust_parameters(settings)
            self._detector.parameters = detector_parameters(settings)
            if settings.reset != self._reset:
                self._robust.reset()
                self._detector.reset()
        self._reset = settings.reset
        self._settings = settings
        return settings

    def _restart(self, settings: TrackerSettings) -> None:
        self._largest = LargestObject(largest_parameters(settings))
        self._robust = RobustTracker(robust_parameters(settings), self._next_id)
        self._detector = DetectorTracker(detector_parameters(settings), self._next_id)

    def _largest_object(self, frame: Frame, bgr: Pixels, settings: TrackerSettings) -> None:
        """Process a frame with the tutorial's pipeline; it has no ids, so ``tracks`` is empty."""
        node = self._node
        found, mask = self._largest.update(bgr)
        node.publish("centroid", centroid_of(node, frame, found))
        self._publish_tracks(frame, (), (), settings)
        drawn = partial(draw, bgr, found)
        node.publish_picture("tracked/compressed", drawn, frame=frame, quality=settings.quality)
        node.publish_picture("mask/compressed", mask, frame=frame, bilevel=True)

    def _all_objects(
        self, frame: Frame, pipeline: RobustTracker | DetectorTracker, settings: TrackerSettings
    ) -> None:
        """Publish what a pipeline with ids found in a frame."""
        node, tracks, shift = self._node, pipeline.tracks, pipeline.shift
        size = frame.header.width, frame.header.height
        self._next_id = pipeline.next_id
        self._report_scene(frame.header, pipeline.shown, blind=pipeline.blind)
        main = pipeline.centroid
        found = None if main is None else MovingObject(main.box, main.area)
        node.publish("centroid", centroid_of(node, frame, found))
        self._publish_tracks(frame, tracks, pipeline.still, settings)
        trails = self._predictions.trails()
        node.publish_picture(
            "tracked/compressed",
            lambda: draw_tracks(frame.bgr, tracks, trails, shift),
            frame=frame,
            quality=settings.quality,
        )
        if not pipeline.has_background:
            return
        mask = partial(enlarged, pipeline.mask, size, pipeline.moved)
        node.publish_picture("mask/compressed", mask, frame=frame, bilevel=True)
        node.publish_picture(
            "background/compressed", pipeline.background, frame=frame, quality=settings.quality
        )

    def expire(self, now_s: float) -> bool:
        """End all tracks if no frame has come for ``EXPIRES_S`` more than they are kept.

        Those of a replay do not end, since it may be paused.

        Their events and one more message of tracks, without any, say so.

        Args:
            now_s: The time by ``time.monotonic``: the camera's clock may be another one.

        Returns:
            Whether tracks, stays in zones and their counts have ended.
        """
        settings, header = self._settings, self._header
        has_tracks = self._robust.tracks or self._detector.tracks
        if settings is None or header is None or not has_tracks:
            return False
        if header.replay is not None:
            return False  # it may be paused for any time, and its results must not depend on that
        if now_s - self._frame_s < settings.keep_lost + EXPIRES_S:
            return False
        self._robust.end_tracks()
        self._detector.end_tracks()
        ended = self._events.end()
        if ended is not None:
            header, (zones, lines) = ended
            self._node.publish("tracks", Tracks(header=header, tracks=(), zones=zones, lines=lines))
        return True

    def _report_scene(self, header: Header, shown: Shown, *, blind: bool) -> None:
        """Report what the pictures make impossible in the node's health, when that changes."""
        found = self._report.update(header.stamp_ns, shown, blind=blind)
        if found != self._reported:
            self._reported = found
            if shown != "scene":
                self._node.counters.note("scene_changes")
            words = f"{header.camera}: {found}" if found else ""
            if found:
                log.warning("%s", words)
            condition = f"scene of {header.camera}"
            self._node.report(condition, Level.WARN if found else Level.OK, words)

    def _publish_tracks(
        self,
        frame: Frame,
        tracks: Sequence[Track],
        still: Sequence[Track],
        settings: TrackerSettings,
    ) -> None:
        header, calibration = self._node.header(frame), self._calibrations.newest(frame.header)
        plane = plane_view(calibration, header.width, header.height)
        self._predictions.update(header, still, settings.anchor, plane)
        zones, lines = self._events.update(frame, still, settings, plane)
        self._node.publish(
            "tracks",
            Tracks(
                header=header,
                tracks=tuple(map(track_message, tracks, places(still, settings.anchor, plane))),
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


@lru_cache(maxsize=64)
def plane_view(calibration: Calibration | None, width: int, height: int) -> PlaneView | None:
    """Return the mapping from a frame's pixels to the plane; None without a calibrated plane.

    A calibration for another size with the same aspect ratio is scaled; one for another aspect
    ratio is not used.
    """
    try:
        return None if calibration is None else calibration.scaled(width, height).view
    except CalibrationFault:
        return None


def largest_parameters(settings: TrackerSettings) -> LargestObjectParameters:
    """Return the tutorial's parameters from the settings of the same names."""
    names = [field.name for field in fields(LargestObjectParameters)]
    return LargestObjectParameters(**{name: getattr(settings, name) for name in names})


def robust_parameters(settings: TrackerSettings) -> RobustParameters:
    """Return the parameters of the pipeline ``robust`` from the settings."""
    foreground = ForegroundParameters(
        var_threshold=settings.var_threshold,
        detect_shadows=settings.detect_shadows,
        learning_s=settings.learning_time,
        frozen=settings.freeze,
        regions=tuple(each.points for each in shapes.polygons(settings.regions)),
        ignored=tuple(each.points for each in shapes.polygons(settings.ignore)),
    )
    return RobustParameters(
        foreground=foreground,
        tracking=TrackingParameters(keep_lost_s=settings.keep_lost),
        min_area=settings.min_area,
        max_area=settings.max_area or math.inf,
        convex=settings.convex,
    )


def detector_parameters(settings: TrackerSettings) -> DetectorParameters:
    """Return the parameters of the pipeline ``detector`` from the settings."""
    return DetectorParameters(
        wanted=Wanted(settings.least_score, classes_of(settings.classes)),
        every=settings.every,
        on_motion=settings.on_motion,
        keep_lost_s=settings.keep_lost,
        foreground=robust_parameters(settings).foreground,
        min_area=settings.min_area,
        at_foot=settings.anchor == "foot",
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
    return TrackMessage(world=world, **{name: getattr(track, name) for name in OF_TRACK})
