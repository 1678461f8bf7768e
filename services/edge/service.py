"""The edge detector's loop."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from common.connection import Connection
from common.frame import Frame
from common.live import LiveSettings
from common.node import Node
from services.edge.canny import detect_edges
from services.edge.settings import EdgeSettings


def run(settings: EdgeSettings, connection: Connection) -> None:
    """Publish the edge map of each frame until told to stop."""
    live = LiveSettings(settings)
    with Node(
        "edge",
        camera=settings.camera,
        connection=connection,
        publishes=["edges"],
        parameters=live,
    ) as node:
        for frame in node.frames("image", want="gray", max_age_s=lambda: live.settings.max_age):
            settings = live.settings
            node.publish_picture(
                "edges",
                frame,
                edges_of(frame, settings),
                encoding="mono8",
                bilevel=True,
                jpeg=settings.format == "jpeg",
                quality=settings.quality,
            )


def edges_of(frame: Frame, settings: EdgeSettings) -> NDArray[np.uint8]:
    """Return a frame's edge map by the settings."""
    return detect_edges(
        frame.gray,
        sigma=settings.sigma,
        low=settings.low,
        high=settings.high,
        aperture=settings.aperture,
        l2=settings.l2,
    )
