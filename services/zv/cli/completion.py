"""Answers shells' requests for completion, with names from the running system where they fit.

A shell waits for the answer, so the arguments that name something in the system are found without
loading the models of the options.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import dataclass, field

import click
from click.shell_completion import CompletionItem, get_completion_class

from zenoh_vision.cli.command import CONNECTION_FLAGS, SWITCHES
from zv.tools.registry import TOOLS, Tool


@dataclass(slots=True)
class Typed:
    """The part of a command line before the word that is to be completed.

    Attributes:
        tool: The tool that it calls.
        arguments: The positional arguments so far.
        connection: The flags of the connection so far.
    """

    tool: Tool
    arguments: list[str] = field(default_factory=list)
    connection: dict[str, str] = field(default_factory=dict)

    def kind(self) -> str:
        """Return the kind of the next argument; empty if it is not a name in the system."""
        kinds, count = self.tool.completes, len(self.arguments)
        if "value" in kinds and count > kinds.index("parameter"):
            return "value" if self._value_is_missing() else "parameter"
        if count < len(kinds) and kinds[count] != "...":
            return kinds[count]
        return kinds[-2] if kinds and kinds[-1] == "..." else ""

    def _value_is_missing(self) -> bool:
        """Tell whether the last argument is a name, and not ``NAME=VALUE`` or a value."""
        missing = False
        for argument in self.arguments[1:]:
            missing = not missing and "=" not in argument
        return missing


def complete(app: click.Command, prog_name: str, variable: str, instruction: str) -> int:
    """Print the completions that a shell asks for; return the exit status."""
    shell, _, _ = instruction.partition("_")
    shells = get_completion_class(shell)
    if shells is None:
        return 1
    asked = shells(app, {}, prog_name, variable)
    words, incomplete = asked.get_completion_args()
    found = completions(words, incomplete)
    items = (
        asked.get_completions(words, incomplete)
        if found is None
        else [CompletionItem(name) for name in found]
    )
    sys.stdout.write("".join(f"{asked.format_completion(item)}\n" for item in items))
    return 0


def completions(words: Sequence[str], incomplete: str) -> list[str] | None:
    """Return the names in the running system that complete a word.

    None if the word does not name something in the system; then the command itself completes it.
    """
    typed = None if incomplete.startswith("-") else typed_so_far(words)
    kind = "" if typed is None else typed.kind()
    if typed is None or not kind:
        return None
    from zv.tools.shared.names import connection_of, names

    node = typed.arguments[0] if typed.arguments else ""
    parameter = typed.arguments[-1] if kind == "value" else ""
    found = names(kind, connection_of(typed.connection), node, parameter)
    taken = {argument.partition("=")[0] for argument in typed.arguments}
    if kind != "value":
        found = [name for name in found if name not in taken]
    return [name for name in found if name.startswith(incomplete)]


def typed_so_far(words: Sequence[str]) -> Typed | None:
    """Parse a command line; return None if it calls no tool, or if an option's value comes next."""
    rest, connection, command = list(words), {}, ""
    typed: Typed | None = None
    while rest:
        word = rest.pop(0)
        flag, equals, value = word.partition("=")
        if flag in CONNECTION_FLAGS:
            if not equals and not rest:
                return None
            connection[flag] = value if equals else rest.pop(0)
        elif word.startswith("-") and word != "-":
            if typed is None and flag not in SWITCHES:
                return None
            if typed is not None and not equals and _takes_value(typed.tool, flag):
                if not rest:
                    return None
                rest.pop(0)
        elif typed is not None:
            typed.arguments.append(word)
        else:
            command = f"{command} {word}".strip()
            if command in TOOLS:
                typed = Typed(TOOLS[command], connection=connection)
    return typed


def _takes_value(tool: Tool, flag: str) -> bool:
    """Tell whether an option takes a value; only this loads the model of the options."""
    if flag in SWITCHES:
        return False
    from zenoh_vision.cli.flags import parameters_of
    from zv.registry import imported

    for option in parameters_of(imported(tool.options)):
        if flag in (*option.opts, *option.secondary_opts):
            return isinstance(option, click.Option) and not option.is_flag
    return False
