"""The camera's loop."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable
from contextlib import closing
from dataclasses import replace

from zenoh_vision import (
    Connection,
    Frame,
    Header,
    Level,
    Node,
    ParameterStore,
    PayloadError,
    Tracks,
)
from zenoh_vision.calibration.calibration import Calibration
from zenoh_vision.calibration.camera_model import CalibrationFault
from zenoh_vision.calibration.ros_yaml import read_calibration
from zenoh_vision.errors import ExpectationNotMet
from zenoh_vision.host.lifeline import is_supervised
from zenoh_vision.image.turn import Size, Turn
from zenoh_vision.node.lockstep import Lockstep
from zenoh_vision.topics import COMPRESSED, Topic, topic_named
from zv.camera import lossless
from zv.camera.audience import wait_for_subscribers
from zv.camera.calibration_latch import CalibrationLatch, without_encoding
from zv.camera.capture import Capture
from zv.camera.convert import Converter
from zv.camera.delivery import Delivery
from zv.camera.geometry import Geometry
from zv.camera.reader import CapturedFrame
from zv.camera.settings import CameraSettings
from zv.camera.source_policy import OpenSource, SourceOpener, expected_rate
from zv.camera.stream_limit import StreamLimit
from zv.registry import published_by

OVER = {
    "still": "the picture changes again",
    "lag": "the source does not lag any more",
    "loss": "no packet was lost for 10 s",
}


def topics(settings: CameraSettings, *, calibrated: bool) -> list[Topic]:
    """Return what a camera publishes; in lockstep nothing is dropped by a link that is full."""
    found = [
        topic_named(name)
        for name in published_by("camera")
        if (name != "truth" or settings.source == "synthetic")
        and (name != "camera_info" or calibrated)
    ]
    if settings.lockstep is None:
        return found
    return [replace(topic, delivery="message") for topic in found]


def run(
    settings: CameraSettings,
    connection: Connection,
    open_source: OpenSource | None = None,
) -> None:
    """Publish the newest frame of the source until it ends or the camera is told to stop.

    Raises:
        SourceError: The source or the calibration file cannot be opened at the start, and the
            settings do not say to wait for it.
        ConfigurationError: The calibration file is wrong, or requested depth is not available.
    """
    calibration = None if settings.calibration is None else read_calibration(settings.calibration)
    parameters = ParameterStore(settings.limited())
    node = Node(
        "camera",
        camera=settings.camera,
        connection=connection,
        publishes=topics(settings, calibrated=calibration is not None),
        parameters=parameters,
    )
    log = logging.getLogger(node.name)

    def stopping() -> bool:
        node.health.loop_alive()
        return node.stopping

    if settings.lockstep is not None:
        with node:
            opener = open_source or SourceOpener()
            publish_all(node, parameters, settings, opener, calibration, stopping)
        return
    with Capture(parameters, node.counters, open_source) as capture:
        node.health.source_lag_ms = capture.lag_ms
        node.expect_rate(expected_rate(capture.kind, settings))
        delivery = Delivery(capture.kind, log)
        parameters.check(delivery.check)
        parameters.watch(
            lambda change: node.expect_rate(expected_rate(capture.kind, change.after.settings))
        )
        if not waits_for_source(settings):
            capture.open()
        with node:
            maker = FrameMaker(node, settings.geometry, calibration)
            limit = stream_limit(node, lambda: parameters.newest.settings.max_kbps)
            if settings.wait_for:
                wait_for_subscribers(node, settings.wait_for, stopping)
            publish_newest(node, capture, delivery, maker, limit, stopping)


def publish_newest(
    node: Node,
    capture: Capture,
    delivery: Delivery,
    maker: FrameMaker,
    limit: StreamLimit,
    stopping: Callable[[], bool],
) -> None:
    """Publish the newest frame of a source each time, until it ends.

    Raises:
        SourceError: As for ``Capture.frames``.
        ParameterRefused: The first picture does not fit the settings of the start.
    """
    log = logging.getLogger(node.name)

    def report(failure: str) -> None:
        log.log(logging.WARNING if failure else logging.INFO, "%s", failure or "pictures are back")
        node.report("source", Level.ERROR if failure else Level.OK, failure)

    def remark(condition: str, words: str) -> None:
        log.log(logging.WARNING if words else logging.INFO, "%s", words or OVER[condition])
        node.report(condition, Level.WARN if words else Level.OK, words)

    for captured in capture.frames(stopping, report, remark):
        if delivery.note(captured):
            node.report("region", Level.WARN if delivery.moved else Level.OK, delivery.moved)
        if (frame := maker.frame(captured)) is not None:
            node.publish_picture(COMPRESSED, frame, compress=limit.compress)
    if capture.ended:
        log.info("%s; --loop plays it again and again", capture.ended)
        node.report("source", Level.OK, capture.ended)  # in the last report


def publish_all(
    node: Node,
    parameters: ParameterStore[CameraSettings],
    settings: CameraSettings,
    open_source: OpenSource,
    calibration: Calibration | None,
    stopping: Callable[[], bool],
) -> None:
    """Publish every frame of a file, each when the named nodes have answered the one before.

    Raises:
        SourceError: The file cannot be opened.
        ConfigurationError: The source is no file.
        ExpectationNotMet: A node has ended, or does not answer.
    """
    log = logging.getLogger(node.name)
    maker = FrameMaker(node, settings.geometry, calibration)
    lockstep = Lockstep(
        node.link, node.connection.namespace, (settings.lockstep or "").split(","), stopping
    )
    with closing(lockstep):
        count = 0
        for captured in lossless.frames(parameters, node.counters, open_source, stopping):
            if not count:
                lockstep.find({node.camera}, None)
            frame = maker.frame(captured)
            if frame is not None and send(node, lockstep, frame):
                lockstep.wait(frame.header)
                count += 1
        log.info("%s ended after %d frames", settings.source, count)


def send(node: Node, lockstep: Lockstep, frame: Frame) -> bool:
    """Publish a frame again and again until somebody takes it; count it once.

    Returns:
        Whether somebody took it; else it is no picture that can be sent, or told to stop.

    Raises:
        ExpectationNotMet: A node has ended, or takes no frame in time.
    """
    frame.captured = False  # it is counted here, and not at each attempt
    try:  # the subscription of the nodes may not yet be known here
        is_taken = lockstep.wait(
            frame.header, lambda: node.publish_picture(COMPRESSED, frame).outcome == "sent"
        )
    except PayloadError as error:
        node.drop(error)
        return False
    except ExpectationNotMet:
        node.counters.drop("no_subscriber")
        raise
    if is_taken:
        node.counters.finish()
    else:
        node.counters.drop("no_subscriber")
    node.health.done(frame.header.age_start_ns)
    return is_taken


def waits_for_source(settings: CameraSettings) -> bool:
    """Tell whether the node starts although its source cannot be opened."""
    wanted = settings.wait_for_source
    return is_supervised() if wanted is None else wanted


def stream_limit(node: Node, max_kbps: Callable[[], int | None]) -> StreamLimit:
    """Return the limit of a camera's compressed pictures, by which its replies and health go."""
    limit = StreamLimit(max_kbps)
    node.limit_replies(COMPRESSED, node.camera, limit.may_reply)
    node.health.remarks["bandwidth"] = limit.words
    return limit


class FrameMaker:
    """Makes the frames of what a camera captured; publishes their calibration and ground truth.

    The calibration is of frames that are turned as at the start, without a region.
    """

    def __init__(self, node: Node, at_start: Geometry, calibration: Calibration | None) -> None:
        self._node = node
        self._at_start = at_start.turn
        self._latch = None if calibration is None else CalibrationLatch(calibration, at_start)
        self._converter = Converter()
        self._settings: CameraSettings | None = None
        self._geometry = at_start
        self._turn = Turn()  # since the start

    def frame(self, captured: CapturedFrame) -> Frame | None:
        """Return the frame; None if it is no picture that can be published, which is counted."""
        node, source = self._node, captured.picture
        settings = captured.revision.settings
        if settings is not self._settings:
            self._settings, self._geometry = settings, settings.geometry
            self._turn = self._geometry.turn.since(self._at_start)
        geometry, turn = self._geometry, self._turn
        try:
            picture = self._converter.picture(source, geometry, settings.encoding, captured.epoch)
        except PayloadError as error:
            node.drop(error)
            return None
        header = Header(
            camera=settings.camera,
            epoch=captured.epoch,
            seq=captured.seq,
            stamp_ns=captured.stamp_ns,
            width=picture.width,
            height=picture.height,
            encoding=picture.encoding,
            node=node.name,
            revision=captured.revision.number,
            replay=captured.replay,
            replayed_ns=None if captured.replay is None else time.time_ns(),
            lockstep=None if captured.replay is None else True,
            rotated=turn.degrees or None,
            mirrored=turn.mirrored or None,
        )
        if self._latch is not None:
            send_calibration(node, self._latch, header, geometry, source.size)
        if captured.truth is not None:
            tracks = geometry.tracks(captured.truth, source.size)
            node.publish("truth", Tracks(header=without_encoding(header), tracks=tracks))
        revision = captured.revision
        return Frame(header, picture, quality=settings.quality, revision=revision, captured=True)


def send_calibration(
    node: Node, latch: CalibrationLatch, header: Header, geometry: Geometry, source: Size
) -> None:
    """Publish the calibration before the first frame for which it differs.

    Programs that subscribe later get it by a query.
    """
    try:
        message = latch.follow(header, geometry, source)
    except CalibrationFault as fault:
        node.report("calibration", Level.WARN, f"no camera_info: {fault}")
        logging.getLogger(node.name).warning("no camera_info: %s", fault)
    else:
        if message is not None:
            node.publish("camera_info", message)
            node.report("calibration", Level.OK)
