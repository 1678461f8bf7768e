"""Durations as people type them: ``5``, ``5s``, ``500ms``, ``2m``.

```python
wait: Annotated[float, Field(ge=0.1, le=60, description="how long to wait"), SECONDS] = 2.0
```

The value is a number of seconds; flags, the environment, TOML files and live parameters accept
texts too.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from pydantic import GetCoreSchemaHandler
from pydantic_core import CoreSchema, core_schema

UNITS = {"ms": 1e-3, "s": 1.0, "m": 60.0, "min": 60.0, "h": 3600.0, "d": 86_400.0}
"""Seconds by unit."""

EXAMPLES = "5, 5s, 500ms, 2m"
LONGEST_S = 9e9
"""Threads cannot wait for longer than 2^63 ns."""

NUMBER = re.compile(r"([0-9]+\.?[0-9]*|\.[0-9]+) *([a-z]*)")


def seconds_of(value: object) -> object:
    """Return the seconds in a text such as ``500ms``; other values unchanged.

    Raises:
        ValueError: The text is no duration.
    """
    if not isinstance(value, str):
        return value
    found = NUMBER.fullmatch(value.strip())
    factor = None if found is None else UNITS.get(found[2] or "s")
    if found is None or factor is None:
        raise ValueError("not a duration")
    # 1e-3 is not exact: 500ms is 500 / 1000.
    seconds = float(found[1]) / 1000 if found[2] == "ms" else float(found[1]) * factor
    if seconds > LONGEST_S:
        raise ValueError("not a duration: longer than 285 years")
    return seconds


def duration_text(seconds: float) -> str:
    """Return a duration in the largest unit of which it is a whole number: ``500ms``, ``2m``."""
    for unit in ("h", "m", "s", "ms"):
        count = seconds / UNITS[unit]
        if count >= 1 and math.isclose(count, round(count)):
            return f"{round(count)}{unit}"
    return f"{seconds:g}s"


@dataclass(frozen=True, slots=True)
class Duration:
    """Marks an option as a duration, whose value is a number of seconds.

    It must be last in an ``Annotated``, so that ``float | None`` accepts texts too.
    """

    def __get_pydantic_core_schema__(
        self, source: Any, handler: GetCoreSchemaHandler
    ) -> CoreSchema:
        """Return the schema of the number, with texts converted first."""
        convert: Callable[[Any], Any] = seconds_of
        return core_schema.no_info_before_validator_function(convert, handler(source))


SECONDS = Duration()
