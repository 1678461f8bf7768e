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
        section: The heading that it stands under in ``zv --help``.
        waits: Whether it waits for a router for ever, as a service does, unless told.
    """

    options: str
    run: str
    line: str
    example: str
    details: str = ""
    json: bool = True
    section: str = "Tools"
    waits: bool = False


GROUPS: Final[dict[str, str]] = {}
"""Commands that have commands of their own, with their line in ``zv --help``."""

TOOLS: Final[dict[str, Tool]] = {
    "metrics": Tool(
        "services.tools.metrics.options:MetricsOptions",
        "services.tools.metrics.command:run",
        "Serve the health of all nodes to Prometheus.",
        "zv metrics --listen 127.0.0.1:9464",
        details="Prints the address that Prometheus scrapes and serves it until Ctrl-C, whether "
        "or not there is a router. docs/metrics.md says what is served.",
        waits=True,
    ),
}
"""Every tool by what one types behind ``zv``: ``snapshot``, ``topic hz``."""
