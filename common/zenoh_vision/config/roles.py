"""Marks of the options that a node itself follows, by which it finds them in any settings.

``max_age: MaxAge = 0.4`` is an option that a node's inputs follow, because the type ``MaxAge`` has
the mark ``Role("max_age")``; an option that is merely called ``max_age`` is the service's own.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import Any, Literal, TypeVar

from zenoh_vision.config.constraints import mark_of
from zenoh_vision.config.settings import Settings

T = TypeVar("T")

RoleName = Literal["transport", "max_age", "depth_min", "depth_max", "quality", "pipeline"]


@dataclass(frozen=True, slots=True)
class Role:
    """Marks an option that the node follows.

    ``transport`` and ``max_age`` of inputs of frames; ``depth_min`` and ``depth_max`` of their
    pictures of 16 bits; ``quality`` of a camera's JPEGs; ``pipeline`` of the node's description.
    """

    name: RoleName


@cache
def option_of(model: type[Settings], role: RoleName) -> str | None:
    """Return the name of the option with a role; None if the settings have none."""
    marked = ((name, mark_of(model, name, Role)) for name in model.model_fields)
    return next((name for name, mark in marked if mark is not None and mark.name == role), None)


def value_of(settings: Settings | None, role: RoleName, default: T) -> T:
    """Return the value of the option with a role; the default if there is none."""
    name = None if settings is None else option_of(type(settings), role)
    found: Any = default if name is None else getattr(settings, name)
    return found  # type: ignore[no-any-return]
