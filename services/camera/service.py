"""The camera's loop."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable

from common.diagnostics import ERROR, OK
from common.errors import PayloadError
from common.messages import Header, Tracks
from common.node import Node
from common.session import Connection
from services.camera.capture import Capture
from services.camera.choice import rate_to_reach
from services.camera.conversion import Converter
from services.camera.reader import Captured
from services.camera.settings import CameraSettings
from services.camera.sources.base import Source

POLL_S = 0.05


def run(
    settings: CameraSettings,
    connection: Connection,
    open_source: Callable[[], Source] | None = None,
) -> None:
    """Publish the newest picture of the source until it ends or the camera is told to stop.

    Args:
        settings: The camera's options.
        connection: Where the router is.
        open_source: Opens a source of one's own instead of the one that the settings name.

    Raises:
        SourceError: The source cannot be opened at the start.
    """
    node = Node(
        "camera",
        camera=settings.camera,
        connection=connection,
        publishes=["image", "raw", *(["truth"] if settings.source == "synthetic" else [])],
        messages=[Tracks] if settings.source == "synthetic" else [],
        counts=("captured", "published"),
    )
    node.health.bounds.expect(settings.rate if open_source else rate_to_reach(settings))
    with Capture(settings, node.ledger, open_source) as capture:
        capture.open_first()
        with node:
            log = logging.getLogger(node.name)
            log.info("%s", capture.description)
            converter = Converter(settings.encoding, settings.flip, settings.quality)

            def report(trouble: str) -> None:
                if trouble:
                    log.warning("%s", trouble)
                else:
                    log.info("pictures are back")
                node.health.report(ERROR if trouble else OK, trouble)

            def stopping() -> bool:
                node.health.turn()
                return node.stopping

            for captured in capture.pictures(POLL_S, stopping, report):
                publish(node, converter, captured, settings.encoding)


def publish(node: Node, converter: Converter, captured: Captured, encoding: str) -> None:
    """Publish one picture and its truth, and count what became of it."""
    picture = captured.picture
    header = Header(
        camera=node.camera,
        epoch=captured.epoch,
        seq=captured.seq,
        stamp_ns=captured.stamp_ns,
        width=picture.width,
        height=picture.height,
        encoding=encoding,
        node=node.name,
        revision=node.revision,
    )
    if picture.truth is not None:
        truth = header.model_copy(update={"encoding": None})
        node.publish("truth", Tracks(header=truth, tracks=picture.truth))
    try:
        published = node.publish_frame(converter.frame(header, picture))
    except PayloadError as error:
        node.dropped(error)
        return
    if published:
        node.ledger.finish()
    else:
        node.ledger.drop("no_subscriber")
    node.health.pace.note(time.monotonic(), (time.time_ns() - captured.stamp_ns) / 1e6)
