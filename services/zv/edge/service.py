"""The edge detector's loop."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import numpy as np

from zenoh_vision import Connection, Frame, Node
from zenoh_vision.errors import PayloadError, SourceError
from zenoh_vision.image.files import decode_image
from zenoh_vision.messages import Contours
from zenoh_vision.topics import EDGE_STAGES
from zv.edge.detectors.detection import COLOURED, Gray
from zv.edge.finding import EdgesOfFrame, decode_ahead, message_of
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
        active = settings  # settings of the previous frame; a change decodes one twice
        frames = node.frames(
            "image/compressed",
            want=lambda frame: decode_ahead(frame, active),
            max_pixels=settings.max_pixels,
            transport=settings.transport,
        )
        for frame in frames:
            active = frame.revision.settings
            try:
                found = EdgesOfFrame(frame, active, mask)
            except PayloadError as error:
                node.counters.note(error.reason)
                node.health.log_drop(error)
                continue
            publish(node, frame, found, active)


def publish(node: Node, frame: Frame, found: EdgesOfFrame, settings: EdgeSettings) -> None:
    """Publish the edge map, the steps and the lines of a frame, each only while subscribed."""
    node.publish_picture(
        "edges/compressed",
        frame,
        lambda: found.edges,
        encoding="mono8",
        bilevel=True,
        jpeg=settings.format == "jpeg",
        bits=settings.format == "bits",
        quality=settings.quality,
    )
    stages = found.stages
    for name in EDGE_STAGES:
        encoding = "bgr8" if name in COLOURED else "mono8"
        node.publish_picture(f"edges/{name}/compressed", frame, stages[name], encoding=encoding)
    node.publish("edges/contours", partial(contours_of, node, frame, found))


def contours_of(node: Node, frame: Frame, found: EdgesOfFrame) -> Contours:
    """Return the message with the lines of a frame; the header is made after they are traced."""
    lines, density = found.lines, found.density
    return message_of(lines, density, node.header(frame))


def read_mask(file: str | None) -> Gray | None:
    """Read the image of the setting ``mask``: (height, width) uint8, 0 where it is black, else 255.

    None if the settings name no mask.

    Raises:
        SourceError: The file cannot be read or decoded.
    """
    if file is None:
        return None
    try:
        pixels = decode_image(Path(file).read_bytes())
    except OSError as error:
        raise SourceError(f"--mask {file}: {error.strerror or error}") from None
    except (ValueError, PayloadError) as error:
        raise SourceError(f"--mask {file}: {error}") from None
    bright = pixels if pixels.ndim == 2 else pixels[..., :3].max(axis=2)
    return np.asarray(np.where(bright > 0, 255, 0), np.uint8)
