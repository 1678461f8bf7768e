"""The camera's loop."""

from __future__ import annotations

import logging

from zenoh_vision import Connection, Header, Level, Node, ParameterStore, PayloadError, Tracks
from zv.camera.capture import Capture
from zv.camera.convert import Converter, mirrored
from zv.camera.reader import CapturedFrame
from zv.camera.settings import CameraSettings
from zv.camera.source_policy import OpenSource, expected_rate, open_source
from zv.registry import published_by


def run(
    settings: CameraSettings,
    connection: Connection,
    open_source: OpenSource = open_source,
) -> None:
    """Publish the newest frame of the source until it ends or the camera is told to stop.

    Raises:
        SourceError: The source cannot be opened at the start.
    """
    parameters = ParameterStore(settings.limited())
    node = Node(
        "camera",
        camera=settings.camera,
        connection=connection,
        publishes=[
            topic
            for topic in published_by("camera")
            if topic != "truth" or settings.source == "synthetic"
        ],
        counts=("captured", "published"),
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
        parameters.watch(lambda change: expect_rate(change.after.settings))
        description = capture.open()
        with node:
            log.info("%s", description)
            converter = Converter()
            for captured in capture.frames(stopping, report):
                publish(node, converter, captured)


def publish(node: Node, converter: Converter, captured: CapturedFrame) -> None:
    """Publish one captured frame and its ground truth, and count the outcome."""
    picture, settings = captured.picture, captured.revision.settings
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
    if picture.truth is not None:
        truth_header = header.model_copy(update={"encoding": None})
        tracks = mirrored(picture.truth, settings.flip, picture.width, picture.height)
        node.publish("truth", Tracks(header=truth_header, tracks=tracks))
    try:
        frame = converter.frame(header, picture, flip=settings.flip, quality=settings.quality)
        frame.revision = captured.revision
        subscribed = node.publish_frame(frame)
    except PayloadError as error:
        node.drop(error)
        return
    if subscribed:
        node.counters.finish()
    else:
        node.counters.drop("no_subscriber")
    node.health.done(captured.stamp_ns)
