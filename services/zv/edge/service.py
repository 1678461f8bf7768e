"""The edge detector's loop."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from zenoh_vision import Connection, Frame, Node
from zv.edge.detectors.canny import detect_edges
from zv.edge.settings import EdgeSettings
from zv.registry import published_by


def run(settings: EdgeSettings, connection: Connection) -> None:
    """Publish the edge map of each frame until told to stop."""
    with Node(
        "edge",
        camera=settings.camera,
        connection=connection,
        publishes=published_by("edge"),
        parameters=settings,
    ) as node:
        frames = node.frames("image/compressed", want="gray", max_pixels=settings.max_pixels)
        for frame in frames:
            settings = frame.revision.settings
            node.publish_picture(
                "edges/compressed",
                frame,
                edges_of(frame, settings),
                encoding="mono8",
                bilevel=True,
                jpeg=settings.format == "jpeg",
                quality=settings.quality,
            )


def edges_of(frame: Frame, settings: EdgeSettings) -> NDArray[np.uint8]:
    """Return the edge map of a frame."""
    return detect_edges(
        frame.gray,
        sigma=settings.sigma,
        low=settings.low,
        high=settings.high,
        aperture=settings.aperture,
        l2=settings.l2,
    )
