"""Click commands whose help shows sections and examples, and groups that load a command on call."""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

import click

from zenoh_vision.error_text import did_you_mean

CONNECTION_FLAGS = {
    "--connect": ("ENDPOINT", "Zenoh endpoint of the router"),
    "--namespace": ("NAMESPACE", "first chunk of every key expression"),
    "--zenoh-config": ("FILE", "Zenoh's JSON5 configuration file"),
    "--credentials": ("FILE", "certificate, key and rights, of zv security"),
    "--timeout": ("DURATION", "how long to wait for a router"),
}
"""The flags of the connection, which may stand before a command's name too. Written here, so that
the help of ``zv`` loads no settings."""

SWITCHES = ("--debug", "--json", "--help", "-h")
"""Flags without a value that many commands have."""

NEGATIVE_NUMBER = re.compile(r"-\.?\d[\d.e+-]*")

HELP_NAMES: Any = {"help_option_names": ["-h", "--help"]}

Sections = Mapping[str, Sequence[click.Parameter]]
"""The parameters of a command by the heading under which its help shows them."""


class _Formatter(click.HelpFormatter):
    """Writes help in colour; Click removes colours if the output is not a terminal."""

    def write_heading(self, heading: str) -> None:
        super().write_heading(click.style(heading, bold=True))

    def write_dl(self, rows: Any, col_max: int = 30, col_spacing: int = 2) -> None:
        coloured = [(click.style(term, fg="cyan"), text) for term, text in rows]
        super().write_dl(coloured, col_max, col_spacing)


class _Context(click.Context):
    formatter_class = _Formatter


class _WithExamples(click.Command):
    """A command whose help ends with command lines that show its use."""

    context_class = _Context
    examples: Sequence[str]

    def get_help_option(self, ctx: click.Context) -> click.Option | None:
        """Return the option for help, described in the form of all the others."""
        option = super().get_help_option(ctx)
        if option is not None:
            option.help = "show this message and exit"
        return option

    def format_epilog(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:  # noqa: ARG002 - Click's signature
        """Write the examples without line breaks, so that they can be copied."""
        if not self.examples:
            return
        with formatter.section("Examples" if len(self.examples) > 1 else "Example"):
            formatter.write("".join(f"  {line}\n" for line in self.examples))


class Command(_WithExamples):
    """A command whose help shows its options in sections, and examples below them.

    Args:
        name: The last word that calls it.
        call: Called with the parameters by name; may return an exit status.
        sections: Its parameters; ``--help`` joins the first section.
        text: What it does, in paragraphs; its first line is the summary.
        examples: Command lines.
    """

    def __init__(
        self,
        name: str,
        call: Callable[..., int | None],
        sections: Sections,
        text: str,
        examples: Sequence[str],
    ) -> None:
        parameters = [each for section in sections.values() for each in section]
        super().__init__(
            name, callback=call, params=parameters, help=text, context_settings=HELP_NAMES
        )
        self.sections = sections
        self.examples = examples

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Parse the arguments; a negative number is a value, not an option.

        Click would refuse ``-1`` as an unknown option. With that check off, it passes unknown
        options on as values, which the command then refuses.
        """
        ctx.ignore_unknown_options = any(map(NEGATIVE_NUMBER.fullmatch, args))
        return super().parse_args(ctx, args)

    def format_options(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the options by section."""
        last: list[click.Parameter | None] = [self.get_help_option(ctx)]
        for heading, parameters in self.sections.items():
            options = [each for each in [*parameters, *last] if isinstance(each, click.Option)]
            last = []
            with formatter.section(heading):
                formatter.write_dl(filter(None, (each.get_help_record(ctx) for each in options)))


def _before_a_command() -> list[click.Option]:
    """Return the options of a group that its commands take."""
    valued = [
        click.Option([flag], metavar=metavar, expose_value=False, help=text)
        for flag, (metavar, text) in CONNECTION_FLAGS.items()
    ]
    debug = click.Option(["--debug"], is_flag=True, expose_value=False, help="log more")
    return [*valued, debug]


def flags_behind_command(arguments: Sequence[str]) -> list[str]:
    """Return a group's arguments with the flags before a command's name moved behind it.

    ``--connect X list --json`` becomes ``list --connect X --json``, so that a flag that is given
    again behind the name overrides it. Without a command the arguments stay as they are.
    """
    place = 0
    while place < len(arguments):
        flag, equals, _ = arguments[place].partition("=")
        if flag in CONNECTION_FLAGS:
            place += 1 if equals else 2
        elif flag == "--debug":
            place += 1
        else:
            break
    if place >= len(arguments) or arguments[place].startswith("-"):
        return list(arguments)
    return [arguments[place], *arguments[:place], *arguments[place + 1 :]]


class Group(_WithExamples, click.Group):
    """A command with commands of its own, each loaded only when it is called.

    Help, completion and suggestions need only names and summaries. Without a command, the group
    shows its help. The flags of the connection may stand before the name of a command.

    Args:
        name: The last word that calls it.
        text: What its commands are for.
        summaries: The summaries of its commands, by name.
        load: Returns the command of a name.
        examples: Command lines.
        heading: Returns the heading under which the help shows a command.
        options: Its own options.
        longer: Names of commands of its groups, such as ``bag play``, to suggest them to who
            leaves the first word out.
    """

    def __init__(
        self,
        name: str,
        text: str,
        summaries: Mapping[str, str],
        load: Callable[[str], click.Command],
        examples: Sequence[str],
        heading: Callable[[str], str] = lambda _: "Commands",
        options: Sequence[click.Option] = (),
        longer: Iterable[str] = (),
    ) -> None:
        listed = {
            member: click.Command(member, short_help=summary)
            for member, summary in summaries.items()
        }
        super().__init__(
            name,
            commands=listed,
            params=[*options, *_before_a_command()],
            help=text,
            context_settings=HELP_NAMES,
        )
        self.load = load
        self.examples = examples
        self.heading = heading
        self._longer = tuple(longer)

    def list_commands(self, ctx: click.Context) -> list[str]:  # noqa: ARG002 - Click's signature
        """Return the names of the commands in their own order; Click would sort them."""
        return list(self.commands)

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Parse the arguments before a command's name; without a command, show the help."""
        given = args if args or ctx.resilient_parsing else ["--help"]
        return super().parse_args(ctx, flags_behind_command(given))

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """Load the command that the first argument names."""
        meant = [words for words in self._longer if words.split()[-1] == args[0]]
        if args[0] not in self.commands and meant and not ctx.resilient_parsing:
            hint = did_you_mean(meant, before="; ")
            raise click.UsageError(f"no such command {args[0]!r}{hint}", ctx)
        name, _, rest = super().resolve_command(ctx, args)
        return name, None if name is None else self.load(name), rest

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:  # noqa: ARG002
        """Write the names and summaries of the commands by heading."""
        rows: dict[str, list[tuple[str, str]]] = {}
        for name, member in self.commands.items():
            rows.setdefault(self.heading(name), []).append((name, member.short_help or ""))
        for heading, members in rows.items():
            with formatter.section(heading):
                formatter.write_dl(members)


def run_command(command: click.Command, name: str, arguments: Sequence[str]) -> int:
    """Run a command under a name, without colours if the user wants none; return its status."""
    plain = bool(os.environ.get("NO_COLOR")) or os.environ.get("TERM") == "dumb"
    try:
        with command.make_context(name, [*arguments], color=False if plain else None) as context:
            return command.invoke(context) or 0
    except click.exceptions.Exit as end:
        return end.exit_code
