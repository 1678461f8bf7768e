"""The tracker's loop over the frames of its cameras: one that waits for the model delays none."""

from __future__ import annotations

import logging
import time
from collections import deque
from dataclasses import dataclass
from typing import Final

from zenoh_vision import Frame, Node
from zenoh_vision.config.settings import ALL_CAMERAS
from zenoh_vision.errors import PayloadError
from zenoh_vision.messages import Level
from zenoh_vision.node.inputs import Input
from zv.registry import published_by
from zv.tracker.camera_tracking import CameraTracking, decoded
from zv.tracker.detector.errors import ModelFailed
from zv.tracker.detector.model import Model
from zv.tracker.detector.placement import Pixels
from zv.tracker.detector.worker import Load, ModelWorker, Request
from zv.tracker.pipelines.detector import UNSURE
from zv.tracker.settings import TrackerSettings

log = logging.getLogger(__name__)

MAX_CAMERAS = 64
"""Largest number of cameras tracked with ``*``; the frames of further ones count as processed and
as ``cameras_left_out``."""

WAIT_S: Final = 1.0
"""A frame waits this long for the model; then it is published without, and the result is used for
a later one. A model that usually takes longer is not waited for."""

REPORT_S: Final = 1.0
"""Interval in which the model's state is reported, and the tracks of silent cameras end."""

Arrived = tuple[Input[Frame], Frame, Pixels | None]
"""A frame that is not finished, after the input that it came from, and before its pixels."""


@dataclass(slots=True)
class Lane:
    """The frames of one camera."""

    tracking: CameraTracking  # tracks its objects
    request: Request | None = None  # what the model has not answered yet
    asked: Frame | None = None  # the frame of that request
    held: Arrived | None = None  # the same frame, if it waits for the answer
    next: Arrived | None = None  # the newest frame that arrived meanwhile


class TrackerLoop:
    """Tracks the objects of each camera that sends frames, all with one model if there is one.

    Each camera has at most one frame in the model or waiting for it; when a newer one arrives
    before the model has begun, that one takes its place. While the model sees a frame, the newest
    frame of its camera waits, and those that it replaces count as overwritten.
    """

    def __init__(self, node: Node, settings: TrackerSettings, model: Model | None) -> None:
        self._node = node
        self._settings = settings
        self._lanes: dict[str, Lane] = {}
        self._results: deque[Request] = deque()
        self._picture: Pixels | None = None  # of the newest frame
        self._reported_s = 0.0
        self._worker: ModelWorker | None = None
        if model is not None:
            self._worker = ModelWorker(model, self._finished)
            log.info("model %s, layout %s, %d classes", model.words, model.layout, len(model.names))

    def run(self) -> None:
        """Process frames until the node is told to stop."""
        settings = self._settings
        try:
            inputs = [
                self._node.frames(
                    "image/compressed",
                    camera=name,
                    want=self._decode,
                    max_pixels=settings.max_pixels,
                    transport=None if name == ALL_CAMERAS else settings.transport,
                )
                for name in settings.cameras or (ALL_CAMERAS,)
            ]
            for arrived in self._node.arrivals(*inputs, is_due=lambda: self._results):
                self._take_results()
                self._end_waits()
                if arrived is None:
                    self._report()
                else:
                    self._arrive((*arrived, self._picture))
        finally:
            if self._worker is not None:
                self._worker.close()

    def _decode(self, frame: Frame) -> None:
        """Decode a frame that no model may see; else the model decides which size is needed."""
        settings: TrackerSettings = frame.revision.settings
        self._picture = None if settings.pipeline == "detector" else decoded(frame, settings)

    def _finished(self, request: Request) -> None:
        self._results.append(request)
        self._node.wake()

    def _arrive(self, arrived: Arrived) -> None:
        source, frame, _ = arrived
        lane = self._lane_of(frame.header.camera)
        if lane is None:
            source.done(frame)
            return
        if lane.held is not None:
            is_seen = lane.request is None or lane.request.begun_s is not None
            if lane.next is not None or not is_seen:
                self._node.counters.drop("overwritten")
            if is_seen:
                lane.next = arrived
                return
            lane.held = lane.request = None
        self._start(lane, arrived)

    def _lane_of(self, camera: str) -> Lane | None:
        """Return the frames of a camera; None if there are ``MAX_CAMERAS`` others already."""
        if camera not in self._lanes:
            if len(self._lanes) >= MAX_CAMERAS:
                self._node.counters.note("cameras_left_out")
                return None
            if camera not in self._node.cameras:
                self._node.add_camera(camera, published_by("tracker"))
            self._lanes[camera] = Lane(CameraTracking(self._node, camera, self._settings))
        return self._lanes[camera]

    def _start(self, lane: Lane, arrived: Arrived) -> None:
        source, frame, picture = arrived
        if picture is not None:
            lane.tracking.process(frame, picture)
            source.done(frame)
            return
        settings: TrackerSettings = frame.revision.settings
        try:
            needs_motion = settings.every != 1 or settings.on_motion
            wants = lane.tracking.begin(frame, decoded(frame, settings) if needs_motion else None)
        except PayloadError as error:
            self._node.drop(error)
            return
        if wants and lane.request is None:
            assert self._worker is not None  # the pipeline needs a model from the start
            lane.request, lane.asked = _request(frame, settings), frame
            self._worker.submit(lane.request)
            is_quick = _longest_s(self._worker.load()) < WAIT_S
            # The results of a replay must not depend on how long the model takes.
            if settings.every and (frame.header.replay is not None or is_quick):
                lane.held = arrived
                return
        self._finish(lane, arrived, None)

    def _finish(self, lane: Lane, waiting: Arrived, request: Request | None) -> None:
        source, frame, _ = waiting
        found = None if request is None or request.found is None else request.found.detections
        lane.tracking.finish(frame, found)
        source.done(frame)

    def _take_results(self) -> None:
        while self._results:
            request = self._results.popleft()
            self._count(request)
            lane = self._lanes[request.camera]
            if request is not lane.request:
                continue  # a newer one took its place
            held, asked = lane.held, lane.asked
            lane.held = lane.request = lane.asked = None
            if held is not None and isinstance(request.error, PayloadError):
                self._node.drop(request.error)
            elif held is not None:
                self._finish(lane, held, request)
            elif asked is not None:
                self._take_late(lane, asked, request)
            self._start_next(lane)

    def _take_late(self, lane: Lane, asked: Frame, request: Request) -> None:
        """Use the result for a frame that was finished without it."""
        if request.found is not None and not lane.tracking.take_late(
            asked, request.found.detections
        ):
            self._node.counters.note("model_too_late")

    def _end_waits(self) -> None:
        """Finish the frames that have waited too long, without the model."""
        now_s = time.monotonic()
        for lane in self._lanes.values():
            if lane.held is None or lane.request is None:
                continue
            is_replay = lane.held[1].header.replay is not None
            if not is_replay and now_s - lane.request.asked_s >= WAIT_S:
                held, lane.held = lane.held, None
                self._finish(lane, held, None)
                self._start_next(lane)

    def _start_next(self, lane: Lane) -> None:
        if lane.next is not None:
            waiting, lane.next = lane.next, None
            self._start(lane, waiting)

    def _count(self, request: Request) -> None:
        counters = self._node.counters
        if isinstance(request.error, ModelFailed):
            counters.note("model_failed")
        if request.found is None:
            return
        counters.note("model_frames")
        counters.note("model_us", round(1e6 * request.run_s))
        counters.note("model_wait_us", round(1e6 * request.waited_s))
        if request.found.not_finite:
            counters.note("model_boxes_not_finite", request.found.not_finite)
        if request.found.left_out:
            counters.note("model_boxes_left_out", request.found.left_out)

    def _report(self) -> None:
        """End the tracks of silent cameras, and report the model's state, once a second."""
        now_s = time.monotonic()
        if now_s - self._reported_s < REPORT_S:
            return
        self._reported_s = now_s
        for lane in self._lanes.values():
            lane.tracking.expire(now_s)
        if self._worker is None:
            return
        load = self._worker.load()
        words = f"model {self._worker.model.words}"
        if load.run_s:
            words += f": {1e3 * load.run_s:.0f} ms a frame, {load.waiting} waiting"
        level = Level.OK
        if load.failed:
            level, words = Level.ERROR, f"{words}; the last run failed: {load.failed}"
        elif _longest_s(load) > WAIT_S:
            level = Level.WARN
            words = (
                f"{words}; it takes {_longest_s(load):.1f} s, so that frames do not wait for it: "
                "take a smaller model, or a device with an accelerator"
            )
        self._node.report("model", level, words)


def _request(frame: Frame, settings: TrackerSettings) -> Request:
    def reduced(width: int, height: int) -> Pixels:
        return frame.reduced("bgr8", width, height)

    size = frame.header.width, frame.header.height
    least = min(settings.least_score, UNSURE)
    return Request(frame.header.camera, size, reduced, least, settings.suppression)


def _longest_s(load: Load) -> float:
    """Return how long the model takes for a picture, in the mean or at the moment."""
    return max(load.run_s, load.since_s)
