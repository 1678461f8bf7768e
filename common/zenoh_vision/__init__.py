"""Cameras and vision on the network over Zenoh: the public names for your own services.

docs/library.md describes the names. Each is imported when it is first used, so that programs that
need only a few of them, such as ``zv --help``, start quickly. ``__init__.pyi`` tells type checkers.
"""

from __future__ import annotations

import importlib
from typing import Any

_NAMES = {
    "zenoh_vision.cli.service": "run_service",
    "zenoh_vision.config.consumer_options": "FrameTransport MaxAge",
    "zenoh_vision.config.parameters": "Live",
    "zenoh_vision.config.revisions": "Change ParameterStore Revision",
    "zenoh_vision.config.roles": "Role",
    "zenoh_vision.config.settings": "ServiceSettings Settings load_settings",
    "zenoh_vision.errors": (
        "ConfigurationError ParameterRefused PayloadError RouterUnreachable SourceError "
        "ToldToStop VisionError"
    ),
    "zenoh_vision.image.frame": "Frame",
    "zenoh_vision.image.picture": "Picture",
    "zenoh_vision.message_codec": "Message",
    "zenoh_vision.messages": (
        "CameraInfo Centroid Contour Contours Diagnostics Header Level NodeDescription "
        "Prediction Stamped Track TrackEvent Tracks"
    ),
    "zenoh_vision.node.inputs": "Input",
    "zenoh_vision.node.node": "Node",
    "zenoh_vision.node.outputs": "Published",
    "zenoh_vision.stream.buffer": "Buffering latest queue",
    "zenoh_vision.stream.counters": "FrameCounters",
    "zenoh_vision.stream.frame_intake": "FrameIntake",
    "zenoh_vision.stream.intake": "Consumer MessageIntake SampleIntake",
    "zenoh_vision.stream.sample": "Sample",
    "zenoh_vision.topics": "TOPICS Topic message_topic",
    "zenoh_vision.transport.connection": "Connection",
}
_MODULES = {name: module for module, names in _NAMES.items() for name in names.split()}

__all__ = sorted(_MODULES)


def __getattr__(name: str) -> Any:
    """Import a public name when it is first used."""
    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = getattr(importlib.import_module(_MODULES[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    """Return the public names."""
    return __all__
