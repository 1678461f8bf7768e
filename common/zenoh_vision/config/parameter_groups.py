"""Parameters that exist only for a time, beside those that are options of the node.

A group brings them, such as the controls of a camera's device while it is open. The store adds and
removes groups while the node runs. What is set in a group is kept in a table among the settings,
so that a configuration file can set it at the start, and it can be set again when the group
returns:

```toml
[controls]
gain = 40        # the parameter control.gain
```
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Protocol

from zenoh_vision.messages import Parameter

TABLE_ENDING = "s"
"""The table of a group ``control`` is called ``controls``."""


class ParameterGroup(Protocol):
    """Some parameters with names ``GROUP.NAME``.

    Attributes:
        table: Name of the setting, a table, that keeps their values: ``controls``.
    """

    table: str

    def parameters(self) -> Sequence[Parameter]:
        """Return a description of each with its present value; ``node`` and ``revision`` unset."""

    def set(self, values: Mapping[str, object]) -> Mapping[str, bool | int | float | str]:
        """Set some, all or none, and return the values to keep.

        Args:
            values: By name, without the group's.

        Raises:
            ParameterRefused: A value is not allowed, or there is no such parameter.
        """

    def watch(self, told: Callable[[], None] | None) -> None:
        """Call a function whenever one has changed without being set here; None to end that."""


def group_name(table: str) -> str:
    """Return the name of the group that a table keeps: ``control`` for ``controls``."""
    return table.removesuffix(TABLE_ENDING)


def table_of(name: str) -> tuple[str, str] | None:
    """Return the table and the key that keep a parameter; None if its name is not of a group."""
    group, dot, key = name.partition(".")
    return (f"{group}{TABLE_ENDING}", key) if dot else None


def flattened(values: Mapping[str, object]) -> dict[str, object]:
    """Return the values of a file, its tables as the parameters that they keep."""
    found: dict[str, object] = {}
    for name, value in values.items():
        if isinstance(value, Mapping) and name.endswith(TABLE_ENDING):
            found |= {f"{group_name(name)}.{key}": each for key, each in value.items()}
        else:
            found[name] = value
    return found
