"""Starts the tracker of one camera, several, or all."""

from __future__ import annotations

import logging

from zenoh_vision import Connection, Node
from zenoh_vision.host.allocator import keep_freed_memory
from zv.registry import published_by
from zv.tracker.detector.class_names import Wanted, check_known
from zv.tracker.detector.model import Model, ModelOptions
from zv.tracker.detector.options import classes_of, size_of
from zv.tracker.loop import TrackerLoop
from zv.tracker.settings import TrackerSettings

log = logging.getLogger(__name__)


def run(settings: TrackerSettings, connection: Connection) -> None:
    """Publish the moving objects of each frame until told to stop.

    Each camera has its own state. Only its newest frame waits, and the cameras are served in turn,
    so a fast, slow or silent camera does not delay the others.

    Raises:
        UnusableModel: The model cannot be run.
        ConfigurationError: A setting does not fit the model.
    """
    keep_freed_memory()
    model = None if settings.model is None else loaded_model(settings)
    names = settings.cameras
    with Node(
        "tracker",
        camera=names[0] if len(names) == 1 else names,
        connection=connection,
        publishes=published_by("tracker"),
        parameters=settings,
    ) as node:
        TrackerLoop(node, settings, model).run()


def loaded_model(settings: TrackerSettings) -> Model:
    """Load the model of the settings.

    Raises:
        UnusableModel: It cannot be run.
        ConfigurationError: A setting does not fit it.
    """
    model = Model(_options_of(settings))
    if settings.pipeline != "detector":
        log.warning(
            "the model is loaded but not used: pipeline = %s; allowed too: detector",
            settings.pipeline,
        )
    check_known(Wanted(settings.least_score, classes_of(settings.classes)), model.names)
    return model


def _options_of(settings: TrackerSettings) -> ModelOptions:
    """Return the options of the model from the settings."""
    assert settings.model is not None
    return ModelOptions(
        settings.model,
        layout=settings.layout,
        class_names=settings.class_names,
        input_size=None if settings.input_size is None else size_of(settings.input_size),
        fit=settings.fit,
        colours=settings.colours,
        values=settings.values,
        runtime=settings.runtime,
        device=settings.device,
        threads=settings.model_threads,
    )
