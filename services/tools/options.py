"""What the options of tools are made of: a base, positional arguments, times and shares.

```python
class HzOptions(ToolOptions):
    keys: Annotated[tuple[str, ...], Argument("KEY"), Field(description="...")]
    window: Annotated[float, Field(gt=0, description="time that is looked at"), SECONDS] = 5.0
    output: Annotated[str, Letter("o"), Field(description="file")] = "-"
    for_: Annotated[...]  # a trailing underscore is not part of the flag: --for
```
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import ClassVar

from pydantic import BeforeValidator

from common.settings import Settings

UNITS_S = {"ms": 1e-3, "s": 1.0, "min": 60.0, "h": 3600.0, "": 1.0}


class ToolOptions(Settings):
    """Base of a tool's options: flags only, neither environment nor file."""

    env_prefix: ClassVar[str] = ""


@dataclass(frozen=True, slots=True)
class Argument:
    """Marks a field that is given by its place instead of by a flag; a tuple takes any number.

    Attributes:
        metavar: How the help names it.
    """

    metavar: str


@dataclass(frozen=True, slots=True)
class Letter:
    """Marks a field that has a short flag too.

    Attributes:
        letter: The flag without its dash.
    """

    letter: str


def _seconds(value: object) -> object:
    """Turn ``500ms``, ``5s``, ``5``, ``2min`` into seconds; leave the rest to the model."""
    if not isinstance(value, str):
        return value
    found = re.fullmatch(r"([0-9.]+) *(ms|s|min|h|)", value.strip())
    if found is None:
        raise ValueError("not a time such as 500ms, 5s, 2min")
    return float(found[1]) * UNITS_S[found[2]]


def _share(value: object) -> object:
    """Turn ``10%`` into 0.1; a bare number is one already."""
    if isinstance(value, str) and value.strip().endswith("%"):
        return float(value.strip()[:-1]) / 100
    return value


SECONDS = BeforeValidator(_seconds)
"""Marks a time in seconds; on the command line with or without its unit. Stands last."""

SHARE = BeforeValidator(_share)
"""Marks a share of one; on the command line also in percent. Stands last."""
