"""The tools there are. A new one is a folder and an entry here; its command follows from it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final


@dataclass(frozen=True, slots=True)
class Tool:
    """One command of a tool.

    Attributes:
        options: Module and class of its options, a ``ToolOptions``.
        run: Module and function that is called with (options, connection, output).
        line: What it does, for the list of commands.
        example: Command lines that show its use.
        details: More of its help, behind the line.
        json: Whether it has ``--json``.
    """

    options: str
    run: str
    line: str
    example: str
    details: str = ""
    json: bool = True


GROUPS: Final[dict[str, str]] = {}
"""Commands that have commands of their own, with their line in ``zv --help``."""

TOOLS: Final[dict[str, Tool]] = {}
"""Every tool by what one types behind ``zv``: ``snapshot``, ``topic hz``."""
