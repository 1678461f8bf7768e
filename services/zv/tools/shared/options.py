"""The base of the options of tools, and types for times and shares on the command line.

```python
class HzOptions(ToolOptions):
    keys: Annotated[tuple[str, ...], Argument("KEY"), Field(description="...")]
    window: Annotated[float, Field(gt=0, description="time to measure"), SECONDS] = 5.0
    output: Annotated[str, Letter("o"), Field(description="file")] = "-"
    for_: Annotated[...]  # a trailing underscore is not part of the flag: --for
```
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import ClassVar

from pydantic import BeforeValidator

from zenoh_vision.config.durations import SECONDS as SECONDS
from zenoh_vision.config.settings import Settings


class ToolOptions(Settings):
    """Base of a tool's options: flags only, neither environment nor file."""

    env_prefix: ClassVar[str] = ""


def number_with_unit(units: Mapping[str, float], examples: str) -> BeforeValidator:
    """Return a validator for numbers with a unit; it must be last in an ``Annotated``.

    Args:
        units: Factors by unit; the empty unit is for a number without a unit.
        examples: Examples of allowed values, for the error text.
    """

    def number(value: object) -> object:
        if not isinstance(value, str):
            return value
        found = re.fullmatch(r"([0-9.]+) *([^0-9.]*)", value.strip())
        if found is None or found[2] not in units:
            raise ValueError(f"not a {examples}")
        return float(found[1]) * units[found[2]]

    return BeforeValidator(number)


SHARE = number_with_unit({"%": 0.01, "": 1.0}, "share such as 10%, 0.1")
"""A share between 0 and 1, or in percent."""
