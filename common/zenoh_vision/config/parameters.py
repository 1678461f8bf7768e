"""Live parameters: describes and changes the options that can change while a node runs.

An option is live if its field is marked; there is no other list of parameters:

```python
quality: Annotated[int, Field(ge=1, le=100, description="JPEG quality"), Live("percent")] = 80
```
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cache
from typing import Any, TypeVar

from pydantic import ValidationError

from zenoh_vision.config.constraints import (
    TYPES,
    allowed,
    bounds,
    choices,
    form_words,
    mark_of,
    reason,
    schema_of,
    wrong_values,
)
from zenoh_vision.config.settings import Settings
from zenoh_vision.error_text import shortened, suggestion
from zenoh_vision.errors import ParameterRefused
from zenoh_vision.messages import Parameter

S = TypeVar("S", bound=Settings)


@dataclass(frozen=True, slots=True)
class Live:
    """Marks an option that can change while the node runs.

    Attributes:
        unit: Unit of its value: ``Hz``, ``s``, ``pixels``; None for a value without one.
        effect: A side effect of a change, such as that the source is opened again.
    """

    unit: str | None = None
    effect: str = ""


@cache
def live_fields(model: type[Settings]) -> dict[str, Live]:
    """Return the live options of a model with their marks, in the model's order."""
    marks = {name: mark_of(model, name, Live) for name in model.model_fields}
    return {name: mark for name, mark in marks.items() if mark is not None}


def parameter(node: str, settings: Settings, name: str, revision: int) -> Parameter:
    """Return the description of a live option: its value, type, limits, unit and meaning."""
    model = type(settings)
    field = model.model_fields[name]
    mark = live_fields(model)[name]
    schema = schema_of(model, name)
    minimum, maximum = bounds(schema)
    about = (field.description, form_words(model, name), mark.effect)
    return Parameter(
        node=node,
        name=name,
        type=TYPES[schema["type"]],
        value=getattr(settings, name),
        default=field.default,
        minimum=minimum,
        maximum=maximum,
        choices=tuple(choices(model, name)) or None,
        unit=mark.unit,
        description="; ".join(filter(None, about)),
        revision=revision,
    )


def changed(settings: S, values: Mapping[Any, object], others: Iterable[str] = ()) -> S:
    """Return settings with some values changed: all of them or, with an error, none.

    Options that are not live are accepted if their value stays the same, so that a whole
    configuration file can be sent. Values are checked as strictly as in a TOML file.

    The given settings are not modified. ``others`` are the names of parameters that are no options,
    for errors.

    Raises:
        ParameterRefused: Names every option and value that is wrong.
    """
    model = type(settings)
    live = live_fields(model)
    for name in values:
        if not isinstance(name, str) or name not in model.model_fields:
            raise no_parameter(model, name, others)
    try:
        found = model.model_validate(
            {**settings.model_dump(), **values}, strict=True, context={"typed": True}
        )
    except ValidationError as error:
        raise _refused(model, values, error) from None
    for name in values:
        if name not in live and getattr(found, name) != getattr(settings, name):
            raise no_parameter(model, name, others)
    return found


def no_parameter(
    model: type[Settings], name: object, others: Iterable[str] = ()
) -> ParameterRefused:
    """Return the refusal of a name that is neither a live option nor one of the others."""
    live = [*live_fields(model), *others]
    if isinstance(name, str) and name in model.model_fields:
        error = f"{name} cannot change while the node runs"
    else:
        hint = suggestion(str(name), live, before="; ")
        error = f"there is no parameter {shortened(name)}{hint}"
    return ParameterRefused(error, ", ".join(live))


def _refused(
    model: type[Settings], values: Mapping[Any, object], error: ValidationError
) -> ParameterRefused:
    """Return the refusal of wrong values, or of valid values that do not fit together."""
    wrong = wrong_values(values, error)
    if not wrong:
        message, _, right = reason(error.errors()[0]).partition("; allowed: ")
        return ParameterRefused(message, right or "values that fit together")
    ranges = {
        name: allowed(model, name)
        + (", or nil: not set" if model.model_fields[name].default is None else "")
        for name in wrong
    }
    if len(wrong) == 1:
        return ParameterRefused(*wrong.values(), *ranges.values())
    return ParameterRefused(
        "; ".join(wrong.values()), "; ".join(f"{name}: {text}" for name, text in ranges.items())
    )
