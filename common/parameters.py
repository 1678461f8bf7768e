"""Which options are live, what a parameter says of itself, and which changes are allowed.

An option is live if its field is marked so; nothing else lists the parameters:

```python
quality: Annotated[int, Field(ge=1, le=100, description="JPEG quality"), Live("percent")] = 80
```
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from typing import Any, TypeVar

from pydantic import ValidationError
from pydantic.fields import FieldInfo

from common.errors import ParameterRefused
from common.excerpt import excerpt
from common.messages import Parameter
from common.near_names import meant
from common.settings import Settings, allowed, properties

S = TypeVar("S", bound=Settings)

TYPES = {"boolean": "bool", "integer": "int", "number": "float", "string": "str"}


@dataclass(frozen=True, slots=True)
class Live:
    """Marks an option that can change while the node runs.

    Attributes:
        unit: Of its value: ``Hz``, ``s``, ``pixels``; None for what has none.
        effect: What a change does beside taking effect: that the source is opened again.
    """

    unit: str | None = None
    effect: str = ""


def mark_of(field: FieldInfo) -> Live | None:
    """Return the mark of a live option; None for one that holds from the start."""
    return next((mark for mark in field.metadata if isinstance(mark, Live)), None)


@cache
def live_fields(model: type[Settings]) -> dict[str, Live]:
    """Return the live options of a model with their marks, in the model's order."""
    marks = {name: mark_of(field) for name, field in model.model_fields.items()}
    return {name: mark for name, mark in marks.items() if mark is not None}


def parameter(node: str, settings: Settings, name: str, revision: int) -> Parameter:
    """Return all there is to say of one live option.

    Args:
        node: The node's name.
        settings: What holds now.
        name: Of the option.
        revision: Of the settings.
    """
    model = type(settings)
    field = model.model_fields[name]
    mark = live_fields(model)[name]
    schema = properties(model)[name]
    kind: dict[str, Any] = next(
        (k for k in schema.get("anyOf", ()) if k.get("type") != "null"), schema
    )
    listed = kind.get("enum") or ([kind["const"]] if "const" in kind else None)
    return Parameter(
        node=node,
        name=name,
        type=TYPES[kind["type"]],
        value=getattr(settings, name),
        default=field.default,
        minimum=kind.get("minimum"),
        maximum=kind["exclusiveMaximum"] - 1 if "exclusiveMaximum" in kind else kind.get("maximum"),
        choices=None if listed is None else tuple(map(str, listed)),
        unit=mark.unit,
        description="; ".join(filter(None, (field.description, mark.effect))),
        revision=revision,
    )


def changed(settings: S, values: Mapping[Any, object]) -> S:
    """Return the settings with some values changed: all of them or, with an error, none.

    A value that is no parameter may be among them if it is what holds already, so that a whole
    configuration file can be sent.

    Args:
        settings: What holds now.
        values: By name; types as strict as in a TOML file.

    Raises:
        ParameterRefused: Naming every name and value that is wrong.
    """
    model = type(settings)
    live = live_fields(model)
    for name in values:
        if not isinstance(name, str) or name not in model.model_fields:
            raise no_parameter(model, name)
    try:
        found = model.model_validate(
            {**settings.model_dump(), **values}, strict=True, context={"typed": True}
        )
    except ValidationError as error:
        raise _refused(model, values, error) from None
    for name in values:
        if name not in live and getattr(found, name) != getattr(settings, name):
            raise no_parameter(model, name)
    return found


def no_parameter(model: type[Settings], name: object) -> ParameterRefused:
    """Return the refusal of a name that is not that of a live option."""
    live = live_fields(model)
    if isinstance(name, str) and name in model.model_fields:
        error = f"{name} cannot change while the node runs"
    else:
        hint = meant(str(name), live, before="; ")
        error = f"there is no parameter {excerpt(name)}{hint}"
    return ParameterRefused(error, ", ".join(live))


def may_be(model: type[Settings], name: str) -> str:
    """Say in words what a parameter may be."""
    field = model.model_fields[name]
    words = allowed(field, name, model).partition("; default ")[0]
    return f"{words}, or nil: not set" if field.default is None else words


def _refused(
    model: type[Settings], wanted: Mapping[str, object], error: ValidationError
) -> ParameterRefused:
    """Say what is wrong with each value; or, if each alone is right, with all together."""
    words: dict[str, str] = {}
    for found in error.errors(include_url=False):
        message = found["msg"].removeprefix("Value error, ")
        if not found["loc"]:
            wrong, _, right = message.partition("; allowed: ")
            return ParameterRefused(wrong, right or "values that fit together")
        name = str(found["loc"][0])
        shown = excerpt(wanted.get(name))
        words.setdefault(name, f"{name} = {shown} is not allowed ({message})")
    ranges = {name: may_be(model, name) for name in words}
    if len(words) == 1:
        return ParameterRefused(*words.values(), *ranges.values())
    return ParameterRefused(
        "; ".join(words.values()), "; ".join(f"{name}: {text}" for name, text in ranges.items())
    )
