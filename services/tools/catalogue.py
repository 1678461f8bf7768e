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


GROUPS: Final[dict[str, str]] = {
    "param": "Read, set, save and load the parameters of nodes that run.",
}
"""Commands that have commands of their own, with their line in ``zv --help``."""

TOOLS: Final[dict[str, Tool]] = {
    "param list": Tool(
        "services.tools.param.options:ListOptions",
        "services.tools.param.commands:list_",
        "Show the parameters of a node, or of all nodes.",
        "zv param list tracker_front",
    ),
    "param get": Tool(
        "services.tools.param.options:NamedOptions",
        "services.tools.param.commands:get",
        "Print the value of a parameter.",
        "zv param get camera_front quality",
        "One is printed alone, several with their names.",
    ),
    "param set": Tool(
        "services.tools.param.options:SetOptions",
        "services.tools.param.commands:set_",
        "Set parameters, all or none.",
        "zv param set edge_front low=30 high=90",
        "In force with the next frame. It is lost when the node ends, unless saved by dump.",
    ),
    "param describe": Tool(
        "services.tools.param.options:NamedOptions",
        "services.tools.param.commands:describe",
        "Say what a parameter is for, its range, unit and default.",
        "zv param describe tracker_front closing",
    ),
    "param dump": Tool(
        "services.tools.param.options:DumpOptions",
        "services.tools.param.commands:dump",
        "Write the parameters of a node as the TOML that --config reads.",
        "zv param dump tracker_front -o tracker.toml",
    ),
    "param load": Tool(
        "services.tools.param.options:LoadOptions",
        "services.tools.param.commands:load",
        "Send the values of a TOML file to a node, all or none.",
        "zv param load tracker_front tracker.toml",
    ),
}
"""Every tool by what one types behind ``zv``: ``snapshot``, ``topic hz``."""
