"""docs/cli.md: every command with its options, made from the commands themselves."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from rich.markup import render

from common.errors import PayloadError, VisionError
from services.cli.failures import FAULT_STATUS
from services.cli.main import COMMANDS, load, one_by_one, section

CONNECTION = "Connection"
"""The panel of the options that tell where the router is; they are the same in most commands."""

INTRODUCTION = """# Command line

Made by `make configs` from the commands themselves; do not edit. `zv COMMAND --help` says the same.

`zv` alone shows the commands. Results go to standard output, logs and errors to standard error; \
an error is one line, with `--debug` also a traceback. There is colour only on a terminal, and \
none where `NO_COLOR` is set. `zv completion SHELL` prints what a shell needs to complete commands \
and options. SIGINT (Ctrl-C) and SIGTERM end every command in order, with status 0.
"""


@dataclass(frozen=True, slots=True)
class Entry:
    """One command: what one types, and what typer makes of it."""

    words: str
    command: Any

    @property
    def members(self) -> list[str]:
        """The names of a group's commands; empty for any other."""
        return list(getattr(self.command, "lines", []))


def entries() -> Iterator[Entry]:
    """Yield every command, each group before its commands."""
    for name in COMMANDS:
        yield from _below(Entry(f"zv {name}", load(name)))


def _below(entry: Entry) -> Iterator[Entry]:
    yield entry
    for member in entry.members:
        command = type(entry.command).load(member)
        yield from _below(Entry(f"{entry.words} {member}", command))


def reference() -> str:
    """Return docs/cli.md."""
    found = list(entries())
    shared = _shared(found)
    parts = [INTRODUCTION, _contents(found), "## Exit status\n", _statuses()]
    for title, text in shared.items():
        parts += [f"## {title}\n", text]
    parts += [_chapter(entry, shared) for entry in found]
    return "\n".join(parts)


def _contents(found: list[Entry]) -> str:
    headings: dict[str, list[Entry]] = {}
    for entry in found:
        headings.setdefault(section(entry.words.split()[1]), []).append(entry)
    parts = []
    for heading, members in headings.items():
        rows = [[f"[{e.words}](#{_anchor(e.words)})", _text(_line(e))] for e in members]
        parts += [f"**{heading}**\n", _table(["command", "what it does"], rows)]
    return "\n".join(parts)


def _statuses() -> str:
    rows = [["0", "done, or told to stop"]]
    ours = [kind for kind in VisionError.__subclasses__() if kind.__module__ == "common.errors"]
    for kind in sorted(ours, key=lambda kind: kind.exit_status):
        if kind.exit_status and kind is not PayloadError:
            rows.append([str(kind.exit_status), _text((kind.__doc__ or "").splitlines()[0])])
    rows.append([str(FAULT_STATUS), "a fault in zv itself; `--debug` shows where"])
    return _table(["status", "meaning"], rows)


def _shared(found: list[Entry]) -> dict[str, str]:
    """Return the tables of connection options that more than one command has, with a title."""
    texts = [_options(entry, CONNECTION) for entry in found if not entry.members]
    several = [text for text in dict.fromkeys(texts) if text and texts.count(text) > 1]
    titles = ["Connection", "Connection of tools"]
    return dict(zip(titles, several, strict=False))


def _chapter(entry: Entry, shared: dict[str, str]) -> str:
    level = "#" * len(entry.words.split())
    parts = [f"{level} {entry.words}\n", f"{_words(entry)}\n"]
    if entry.members:
        names = [f"{entry.words} {member}" for member in entry.members]
        return "\n".join([*parts, ", ".join(f"[{n}](#{_anchor(n)})" for n in names) + "\n"])
    context = entry.command.make_context(entry.words, [], resilient_parsing=True)
    usage = context.get_usage().removeprefix("Usage: ")
    parts.append(f"```text\n{usage}\n```\n")
    parts.append(_options(entry, *{_panel(p) for p in entry.command.params} - {CONNECTION}))
    connection = _options(entry, CONNECTION)
    title = next((title for title, text in shared.items() if text == connection), None)
    if title is not None:
        parts.append(f"Where the router is: [{title}](#{_anchor(title)}).\n")
    elif connection:
        parts.append(connection)
    return "\n".join(parts)


def _options(entry: Entry, *panels: str) -> str:
    rows = [
        [_spelling(parameter), _text(_plain(parameter.help or ""))]
        for parameter in entry.command.params
        if _panel(parameter) in panels and not parameter.hidden
    ]
    return _table(["option", "meaning"], rows) if rows else ""


def _panel(parameter: Any) -> str:
    return getattr(parameter, "rich_help_panel", None) or ""


def _spelling(parameter: Any) -> str:
    if parameter.param_type_name == "argument":
        return f"`{parameter.metavar or parameter.name.upper()}`"
    names = [*parameter.opts, *parameter.secondary_opts]
    value = "" if parameter.is_flag else f" {parameter.metavar or parameter.name.upper()}"
    return ", ".join(f"`{name}{value}`" for name in names)


def _words(entry: Entry) -> str:
    """Return a command's help: its examples as code, the rest as text."""
    paragraphs = _plain(entry.command.help or "").strip().split("\n\n")
    paragraphs += _plain(entry.command.epilog or "").strip().split("\n\n")
    shown = []
    for paragraph in filter(None, paragraphs):
        before, example, command = paragraph.partition("Example: ")
        if example:
            lines = "\n".join(one_by_one(command))
            shown.append(f"{_text(before)}\n```sh\n{lines}\n```".strip())
        else:
            shown.append(_text(" ".join(paragraph.split())))
    return "\n\n".join(shown)


def _line(entry: Entry) -> str:
    return _plain(entry.command.help or "").strip().splitlines()[0]


def _plain(text: str) -> str:
    """Return a help text without the marks that rich reads."""
    return render(text).plain


def _text(text: str) -> str:
    """Return a text so that Markdown shows it as it is."""
    for mark in ("\\", "*", "_", "<", "[", "|"):
        text = text.replace(mark, f"\\{mark}")
    return text


def _anchor(title: str) -> str:
    return title.lower().replace(" ", "-")


def _table(titles: list[str], rows: list[list[str]]) -> str:
    lines = [titles, ["---"] * len(titles), *rows]
    return "".join(f"| {' | '.join(line)} |\n" for line in lines)
