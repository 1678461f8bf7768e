"""The camera's loop."""

from __future__ import annotations

import logging
import time
from dataclasses import replace

from zenoh_vision import Connection, Header, Level, Node, ParameterStore, PayloadError, Tracks
from zenoh_vision.calibration.camera_model import CalibrationFault
from zenoh_vision.calibration.ros_yaml import read_calibration
from zenoh_vision.topics import COMPRESSED
from zv.camera.calibration_latch import CalibrationLatch
from zv.camera.capture import Capture
from zv.camera.convert import Converter, mirrored
from zv.camera.delivery import Delivery
from zv.camera.reader import CapturedFrame
from zv.camera.region import cropped
from zv.camera.settings import CameraSettings
from zv.camera.source_policy import OpenSource, expected_rate, open_source
from zv.camera.stream_limit import StreamLimit
from zv.registry import published_by


def run(
    settings: CameraSettings,
    connection: Connection,
    open_source: OpenSource = open_source,
) -> None:
    """Publish the newest frame of the source until it ends or the camera is told to stop.

    Raises:
        SourceError: The source or the calibration file cannot be opened at the start.
        ConfigurationError: The calibration file is wrong, or requested depth is not available.
    """
    calibration = None if settings.calibration is None else read_calibration(settings.calibration)
    parameters = ParameterStore(settings.limited())
    node = Node(
        "camera",
        camera=settings.camera,
        connection=connection,
        publishes=[
            topic
            for topic in published_by("camera")
            if (topic != "truth" or settings.source == "synthetic")
            and (topic != "camera_info" or calibration is not None)
        ],
        parameters=parameters,
    )
    log = logging.getLogger(node.name)

    def expect_rate(newest: CameraSettings) -> None:
        node.health.rates.expect(expected_rate(capture.kind, newest))

    def report(failure: str) -> None:
        log.log(logging.WARNING if failure else logging.INFO, "%s", failure or "pictures are back")
        node.health.report(Level.ERROR if failure else Level.OK, failure)

    def stopping() -> bool:
        node.health.loop_alive()
        return node.stopping

    with Capture(parameters, node.counters, open_source) as capture:
        expect_rate(settings)
        delivery = Delivery(capture.kind, log)
        parameters.check(delivery.check)
        parameters.watch(lambda change: expect_rate(change.after.settings))
        description = capture.open()
        with node:
            log.info("%s", description)
            converter, limit = Converter(), StreamLimit()
            latch = None if calibration is None else CalibrationLatch(calibration, settings.flip)
            node.outputs.limit_replies(COMPRESSED, settings.camera, limit.may_reply)
            for captured in capture.frames(stopping, report):
                delivery.note(captured)
                publish(node, converter, captured, limit, latch)
            if capture.ended:
                log.info("%s; --loop plays it again and again", capture.ended)
                node.health.report(Level.OK, capture.ended)  # in the last report


def publish(
    node: Node,
    converter: Converter,
    captured: CapturedFrame,
    limit: StreamLimit,
    latch: CalibrationLatch | None = None,
) -> None:
    """Publish one captured frame, its calibration and ground truth; count the outcome."""
    settings, whole = captured.revision.settings, captured.picture
    box = settings.box
    try:
        if box is not None:
            captured = replace(captured, picture=cropped(whole, box, settings.flip))
        picture, quality = limit.fit(captured, time.monotonic())
    except PayloadError as error:
        node.drop(error)
        return
    header = Header(
        camera=node.camera,
        epoch=captured.epoch,
        seq=captured.seq,
        stamp_ns=captured.stamp_ns,
        width=picture.width,
        height=picture.height,
        encoding=settings.encoding,
        node=node.name,
        revision=captured.revision.number,
    )
    if latch is not None:
        send_calibration(node, latch, header, settings, (whole.width, whole.height))
    if picture.truth is not None:
        truth_header = header.model_copy(update={"encoding": None})
        tracks = mirrored(picture.truth, settings.flip, picture.width, picture.height)
        node.publish("truth", Tracks(header=truth_header, tracks=tracks))
    try:
        frame = converter.frame(header, picture, flip=settings.flip, quality=quality)
    except PayloadError as error:
        node.drop(error)
        return
    frame.revision = captured.revision
    node.own_frames.publish_pending(frame, limit.may_send)
    node.health.remark = limit.words


def send_calibration(
    node: Node,
    latch: CalibrationLatch,
    header: Header,
    settings: CameraSettings,
    whole: tuple[int, int],
) -> None:
    """Publish the calibration before the first picture for which it differs.

    Programs that subscribe later get it by a query.
    """
    try:
        plain = header.model_copy(update={"encoding": None})
        message = latch.follow(plain, settings.flip, whole, settings.box)
    except CalibrationFault as fault:
        node.health.report(Level.WARN, f"no camera_info: {fault}")
        logging.getLogger(node.name).warning("no camera_info: %s", fault)
    else:
        if message is not None:
            node.publish("camera_info", message)
