"""The edge detector's loop."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import numpy as np

from zenoh_vision import Connection, Frame, Node
from zenoh_vision.errors import PayloadError, SourceError
from zenoh_vision.image.files import decoded
from zenoh_vision.topics import EDGE_STAGES
from zv.edge.detectors.rendering import Gray
from zv.edge.finding import EdgesOfFrame, decode_ahead
from zv.edge.settings import EdgeSettings
from zv.registry import published_by


def run(settings: EdgeSettings, connection: Connection) -> None:
    """Publish edge map, steps and lines of each frame until told to stop."""
    mask = read_mask(settings.mask)
    with Node(
        "edge",
        camera=settings.camera,
        connection=connection,
        publishes=published_by("edge"),
        parameters=settings,
    ) as node:
        frames = node.frames(
            "image/compressed",
            want=lambda frame: decode_ahead(frame, frame.revision.settings),
            max_pixels=settings.max_pixels,
            transport=settings.transport,
        )
        for frame in frames:
            active: EdgeSettings = frame.revision.settings
            try:
                found = EdgesOfFrame(frame, active, mask)
            except PayloadError as error:
                node.counters.note(error.reason)
                node.health.log_drop(error)
                continue
            node.publish_if_wanted(frame, partial(publish, node, frame, found, active))


def publish(node: Node, frame: Frame, found: EdgesOfFrame, settings: EdgeSettings) -> None:
    """Publish the edge map, the steps and the lines of a frame, each only while subscribed."""
    node.publish_picture(
        "edges/compressed",
        lambda: found.edges,
        frame=frame,
        bilevel=True,
        form=settings.format,
        quality=settings.quality,
    )
    stages = found.stages
    for name in EDGE_STAGES:
        node.publish_picture(f"edges/{name}/compressed", stages[name], frame=frame)
    node.publish("edges/contours", lambda: found.message(lambda: node.header(frame)))


def read_mask(file: str | None) -> Gray | None:
    """Read the image of the setting ``mask``: (height, width) uint8, 0 where it is black, else 255.

    None if the settings name no mask.

    Raises:
        SourceError: The file cannot be read or decoded.
    """
    if file is None:
        return None
    try:
        pixels = decoded(Path(file).read_bytes()).pixels
    except OSError as error:
        raise SourceError(f"--mask {file}: {error.strerror or error}") from None
    except (ValueError, PayloadError) as error:
        raise SourceError(f"--mask {file}: {error}") from None
    bright = pixels if pixels.ndim == 2 else pixels[..., :3].max(axis=2)
    return np.asarray(np.where(bright > 0, 255, 0), np.uint8)
