"""The camera's loop."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable

from common.connection import Connection
from common.diagnostics import ERROR, OK
from common.errors import PayloadError
from common.live import LiveSettings
from common.messages import Header, Tracks
from common.node import Node
from services.camera.capture import Capture
from services.camera.choice import rate_to_reach
from services.camera.conversion import Converter, mirrored
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
    live = LiveSettings(settings)
    node = Node(
        "camera",
        camera=settings.camera,
        connection=connection,
        publishes=["image", "raw", *(["truth"] if settings.source == "synthetic" else [])],
        messages=[Tracks] if settings.source == "synthetic" else [],
        counts=("captured", "published"),
        parameters=live,
    )
    own = None if open_source is None else lambda _settings, _newest: open_source()
    with Capture(live, node.ledger, own) as capture:

        def expect(newest: CameraSettings) -> None:
            known = rate_to_reach(capture.kind, newest)
            node.health.bounds.expect(newest.rate if open_source else known)

        expect(settings)
        live.watch(lambda change: expect(change.after.settings))
        capture.open_first()
        with node:
            log = logging.getLogger(node.name)
            log.info("%s", capture.description)
            converter = Converter(*look(settings))
            made_for = settings

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
                now = captured.revision.settings
                if look(now) != look(made_for):
                    converter, made_for = Converter(*look(now)), now
                publish(node, converter, captured)


def look(settings: CameraSettings) -> tuple[str, str, int]:
    """Return what a converter is made of."""
    return settings.encoding, settings.flip, settings.quality


def publish(node: Node, converter: Converter, captured: Captured) -> None:
    """Publish one picture and its truth, and count what became of it."""
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
        truth = header.model_copy(update={"encoding": None})
        tracks = mirrored(picture.truth, settings.flip, picture.width, picture.height)
        node.publish("truth", Tracks(header=truth, tracks=tracks))
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
