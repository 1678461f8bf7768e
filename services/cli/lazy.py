"""Groups of commands that load a command when it is called, not before."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import typer
from typer.core import TyperCommand, TyperGroup


class LazyGroup(TyperGroup):
    """A group that knows its commands' names and lines, and how to load one."""

    lines: Mapping[str, str]
    sections: Mapping[str, str]
    load: Callable[[str], Any]
    listing = False

    def __init__(self, **attributes: Any) -> None:
        super().__init__(**attributes)
        # Only their names and lines: for the list, and to find what a mistyped one was to be.
        self.commands = {
            name: TyperCommand(name, help=line, rich_help_panel=self.sections.get(name))
            for name, line in self.lines.items()
        }

    def list_commands(self, ctx: Any) -> list[str]:  # noqa: ARG002 - typer's signature
        """Return all names."""
        return list(self.lines)

    def get_command(self, ctx: Any, cmd_name: str) -> Any:  # noqa: ARG002 - typer's signature
        """Return a command; for the list of commands only its name and line."""
        if cmd_name not in self.lines:
            return None
        if self.listing:
            return self.commands[cmd_name]
        return type(self).load(cmd_name)

    def format_help(self, ctx: Any, formatter: Any) -> None:
        """Write the help without loading any command."""
        self.listing = True
        super().format_help(ctx, formatter)

    def shell_complete(self, ctx: Any, incomplete: str) -> Any:
        """Return what may follow, without loading any command."""
        self.listing = True
        return super().shell_complete(ctx, incomplete)


def lazy(
    lines: Mapping[str, str],
    load: Callable[[str], Any],
    sections: Mapping[str, str] | None = None,
) -> type[LazyGroup]:
    """Return the class of a group.

    Args:
        lines: Names of its commands, and what ``--help`` says of each.
        load: Called with a name, returns the command.
        sections: Under which heading ``--help`` shows each.
    """
    members = {"lines": lines, "load": staticmethod(load), "sections": sections or {}}
    return type("Group", (LazyGroup,), members)


def group(
    name: str, words: str, lines: Mapping[str, str], load: Callable[[str], Any], epilog: str = ""
) -> Any:
    """Return a group below ``zv``; without a command it shows its help."""
    single = typer.Typer(
        name=name,
        cls=lazy(lines, load),
        no_args_is_help=True,
        add_completion=False,
        pretty_exceptions_enable=False,
        help=words,
        epilog=epilog,
    )

    @single.callback()
    def _root() -> None: ...

    _root.__doc__ = words
    return typer.main.get_command(single)
