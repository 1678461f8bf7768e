"""The tracker's loop."""

from __future__ import annotations

from dataclasses import fields
from functools import partial

from zenoh_vision import Centroid, Connection, Frame, Node
from zv.registry import published_by
from zv.tracker.pipelines.largest import LargestObject, LargestObjectParameters, MovingObject, draw
from zv.tracker.settings import TrackerSettings


def run(settings: TrackerSettings, connection: Connection) -> None:
    """Publish the largest moving object of each frame until told to stop."""
    with Node(
        "tracker",
        camera=settings.camera,
        connection=connection,
        publishes=published_by("tracker"),
        parameters=settings,
    ) as node:
        learned_from: tuple[object, ...] = ()
        frames = node.frames("image/compressed", want="bgr", max_pixels=settings.max_pixels)
        for frame in frames:
            header, settings = frame.header, frame.revision.settings
            parameters = parameters_of(settings)
            # The background is learned again for a new epoch, size or pipeline. Changes of all
            # other settings keep it.
            stream = (header.epoch, header.width, header.height, settings.pipeline)
            if learned_from != stream:
                learned_from = stream
                tracker = LargestObject(parameters)
            else:
                tracker.adjust(parameters)
            found, mask = tracker.update(frame.bgr)
            node.publish("centroid", centroid_of(node, frame, found))
            drawn = partial(draw, frame.bgr, found)
            node.publish_picture("tracked/compressed", frame, drawn, quality=settings.quality)
            node.publish_picture("mask/compressed", frame, mask, encoding="mono8", bilevel=True)


def parameters_of(settings: TrackerSettings) -> LargestObjectParameters:
    """Return the pipeline's parameters from the settings of the same names."""
    names = [field.name for field in fields(LargestObjectParameters)]
    return LargestObjectParameters(**{name: getattr(settings, name) for name in names})


def centroid_of(node: Node, frame: Frame, found: MovingObject | None) -> Centroid:
    """Return the message for a frame, with the object that was found or without."""
    header = node.header(frame)
    if found is None:
        return Centroid(header=header, x=None, y=None, box=None, area=None)
    x, y = found.center
    return Centroid(header=header, x=x, y=y, box=found.box, area=found.area)
