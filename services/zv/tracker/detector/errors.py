"""Errors of a model's file and of its runs."""

from __future__ import annotations

from zenoh_vision.errors import ConfigurationError, SourceError


class UnusableModel(SourceError):
    """The file cannot be read, is no ONNX model, or cannot be run here."""


class UnknownLayout(ConfigurationError):
    """What the model's inputs or outputs mean cannot be known without a setting."""


class ModelFailed(Exception):
    """A run of the model failed; the next one may not."""
