"""The tracker's loop."""

from __future__ import annotations

from functools import partial

from common.connection import Connection
from common.frame import Frame
from common.live import LiveSettings
from common.messages import Centroid
from common.node import Node
from services.tracker.drawing import draw
from services.tracker.largest import LargestObject, MovingObject, Numbers
from services.tracker.settings import TrackerSettings


def run(settings: TrackerSettings, connection: Connection) -> None:
    """Publish the largest moving object of each frame until told to stop."""
    live = LiveSettings(settings)
    with Node(
        "tracker",
        camera=settings.camera,
        connection=connection,
        publishes=["centroid", "tracked", "mask"],
        messages=[Centroid],
        parameters=live,
    ) as node:
        begun_with: tuple[object, ...] = ()
        for frame in node.frames("image", want="bgr", max_age_s=lambda: live.settings.max_age):
            header, settings = frame.header, live.settings
            # What was background before a reopen, at another size, or to another chain, is none
            # now. All other settings leave what was learned as it is.
            begins = (header.epoch, header.width, header.height, settings.pipeline)
            if begun_with != begins:
                begun_with = begins
                tracker = tracker_of(settings)
            else:
                tracker.adjust(**numbers_of(settings))
            found, mask = tracker.update(frame.bgr)
            node.publish("centroid", centroid_of(node, frame, found))
            node.publish_picture(
                "tracked",
                frame,
                partial(draw, frame.bgr, found),
                quality=settings.quality,
            )
            node.publish_picture("mask", frame, mask, encoding="mono8", bilevel=True)


def tracker_of(settings: TrackerSettings) -> LargestObject:
    """Return a tracker with an empty background model."""
    return LargestObject(**numbers_of(settings))


def numbers_of(settings: TrackerSettings) -> Numbers:
    """Return the numbers of the chain."""
    return Numbers(
        history=settings.history,
        var_threshold=settings.var_threshold,
        detect_shadows=settings.detect_shadows,
        closing=settings.closing,
        median=settings.median,
        threshold=settings.threshold,
    )


def centroid_of(node: Node, frame: Frame, found: MovingObject | None) -> Centroid:
    """Return the message for what was found in a frame."""
    header = node.header(frame)
    if found is None:
        return Centroid(header=header, x=None, y=None, box=None, area=None)
    x, y = found.center
    return Centroid(header=header, x=x, y=y, box=found.box, area=found.area)
