"""What a user expects of any command: help, near names, one line an error, colour where it fits."""

from __future__ import annotations

import re
import shlex
import subprocess
import sys
import threading
from collections.abc import Iterator

import pytest
from rich.markup import render

from common.errors import ConfigurationError, ToldToStop
from services.cli import failures
from services.cli.failures import FAULT_STATUS
from services.cli.main import COMMANDS, example, section
from services.cli.reference import Entry, entries
from tests.integration.terminal import Terminal
from tests.processes import ROOT, START_S, environment

HEAVY = {
    "av",
    "cv2",
    "numpy",
    "prometheus_client",
    "psutil",
    "pydantic_settings",
    "simplejpeg",
    "zenoh",
}
"""What takes long to load, and what no help needs."""

COLOUR = re.compile(r"\x1b\[[0-9;]*\b(3[0-7]|9[0-7]|38;[0-9;]+)m")


def zv(*arguments: str, **variables: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "services", *arguments],
        capture_output=True,
        text=True,
        cwd=ROOT,
        env={**environment(), **variables},
        timeout=START_S,
        check=False,
    )


ENTRIES = {entry.words: entry for entry in entries()}
SINGLE = [words for words, entry in ENTRIES.items() if not entry.members]


# Help


def test_zv_alone_shows_the_commands_in_groups_with_examples():
    done = zv()
    assert (done.returncode, done.stderr) == (0, "")
    headings = [section(name) for name in COMMANDS]
    places = [done.stdout.index(f"─ {heading} ─") for heading in dict.fromkeys(headings)]
    assert places == sorted(places)
    assert {"Services", "Tools"} < set(headings)
    for name in COMMANDS:
        assert re.search(rf"^│ {name} ", done.stdout, re.MULTILINE)
    below = done.stdout.partition("Examples:")[2].split("\n")
    assert [line.strip() for line in below[1:3]] == ["zv up", example("camera")]


@pytest.mark.parametrize("words", SINGLE)
def test_the_help_of_a_command_has_an_example_that_parses(words: str):
    text = render(ENTRIES[words].command.help).plain
    examples = [shlex.split(line, comments=True) for line in command_lines(text)]
    assert examples, "no example"
    for given in examples:
        entry, arguments = entry_of(given)
        with entry.command.make_context(entry.words, arguments):
            pass


def command_lines(text: str) -> Iterator[str]:
    """Yield the commands of a help's examples, without the pipes around them."""
    for line in text.partition("Example: ")[2].splitlines():
        for part in re.split(r"[|;]|&&|>", line):
            if part.strip().startswith("zv "):
                yield part.strip()


def entry_of(given: list[str]) -> tuple[Entry, list[str]]:
    """Return the command that a line calls, and its arguments."""
    for count in (3, 2):
        if " ".join(given[:count]) in ENTRIES:
            return ENTRIES[" ".join(given[:count])], given[count:]
    raise AssertionError(f"no such command: {given}")


def test_help_loads_nothing_that_takes_long():
    # One process for all commands: each is loaded and its help written.
    program = f"""
import contextlib, io, sys
from services.cli.main import COMMANDS, run
def helped(*words):
    sys.argv = ["zv", *words, "--help"]
    with contextlib.redirect_stdout(io.StringIO()) as text:
        assert run() == 0
    assert "Usage" in text.getvalue()
    loaded = {HEAVY!r} & set(sys.modules)
    assert not loaded, (words, loaded)
helped()
assert not {{"zenoh", "services.cli.options"}} & set(sys.modules)
for words in {list(ENTRIES)!r}:
    helped(*words.split()[1:])
"""
    done = subprocess.run(
        [sys.executable, "-c", program],
        capture_output=True,
        text=True,
        cwd=ROOT,
        env=environment(),
        timeout=START_S,
        check=False,
    )
    assert done.returncode == 0, done.stderr


# Errors


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["trakker"], "zv: no such command 'trakker'. Did you mean 'tracker'?; see zv --help"),
        (["xyz"], "zv: no such command 'xyz'; see zv --help"),
        (["camera", "--bogus"], "zv: no such option: --bogus; see zv camera --help"),
        (
            ["camera", "--reopen-mix", "1"],
            "zv: no such option: --reopen-mix (Possible options: --reopen-max, --reopen-min); "
            "see zv camera --help",
        ),
        (["camera", "--rate"], "zv: option '--rate' requires an argument"),
        (["edge", "x"], "zv: got unexpected extra argument(s) (x); see zv edge --help"),
        (
            ["completion", "tcsh"],
            "zv: invalid value for 'SHELL': 'tcsh' is not one of 'bash', 'zsh', 'fish'; "
            "see zv completion --help",
        ),
        (["completion"], "zv: missing argument 'SHELL'"),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, list) else "",
)
def test_wrong_use_is_2_and_one_line_with_the_near_name(arguments: list[str], said: str):
    done = zv(*arguments)
    assert (done.returncode, done.stdout) == (2, "")
    (line,) = done.stderr.splitlines()
    assert line.startswith(said)


def surprise(*flags: str) -> subprocess.CompletedProcess[str]:
    """Run a service whose code raises what nobody foresaw."""
    program = (
        "import sys, services.edge.service as edge, services.cli.main as cli\n"
        "def run(*_): raise KeyError('nobody\\nforesaw')\n"
        "edge.run = run\n"
        f"sys.argv = {['zv', 'edge', *flags]!r}\n"
        "cli.main()"
    )
    return subprocess.run(
        [sys.executable, "-c", program],
        capture_output=True,
        text=True,
        cwd=ROOT,
        env=environment(),
        timeout=START_S,
        check=False,
    )


def test_a_fault_of_ours_is_70_and_one_line_that_says_so():
    done = surprise()
    assert (done.returncode, done.stdout) == (FAULT_STATUS, "")
    assert done.stderr == (
        "zv: unexpected KeyError: 'nobody\\nforesaw'; this is a fault in zv, --debug shows where\n"
    )


def test_with_debug_a_fault_shows_its_traceback_too():
    done = surprise("--debug")
    assert done.returncode == FAULT_STATUS
    assert "Traceback (most recent call last)" in done.stderr
    assert done.stderr.splitlines()[-1].startswith("zv: unexpected KeyError")


def test_with_debug_an_error_of_the_users_shows_where_it_was_found():
    done = zv("edge", "--sigma", "99", "--debug")
    assert done.returncode == 2
    assert "Traceback (most recent call last)" in done.stderr
    assert done.stderr.splitlines()[-1].startswith("zv: command line: --sigma")


def test_an_error_in_a_thread_is_one_line(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
):
    monkeypatch.setattr(threading, "excepthook", threading.excepthook)
    failures.watch_threads(debug=False)
    thread = threading.Thread(target=lambda: 1 // 0, name="reader")
    thread.start()
    thread.join()
    assert capsys.readouterr().err == (
        "zv: in thread reader: unexpected ZeroDivisionError: integer division or modulo by zero; "
        "this is a fault in zv, --debug shows where\n"
    )


@pytest.mark.parametrize(
    ("error", "status", "said"),
    [
        (ConfigurationError("high must be above low"), 2, "zv: high must be above low\n"),
        (ToldToStop("told to stop"), 0, ""),
    ],
)
def test_an_error_of_ours_has_its_own_status(
    error: Exception, status: int, said: str, capsys: pytest.CaptureFixture[str]
):
    assert failures.tell(error, debug=False) == status
    assert capsys.readouterr().err == said


# Colour


def test_there_is_no_colour_in_a_pipe():
    for done in (zv("--help"), zv("camera", "--help"), zv("camra")):
        assert "\x1b" not in done.stdout + done.stderr


@pytest.mark.parametrize(
    ("variables", "coloured"),
    [({}, True), ({"NO_COLOR": "1"}, False), ({"TERM": "dumb"}, False)],
    ids=["terminal", "NO_COLOR", "a terminal that knows none"],
)
def test_there_is_colour_on_a_terminal_that_wants_it(variables: dict[str, str], coloured: bool):
    terminal = Terminal(["--help"], variables=variables)
    terminal.until(lambda text: "zv COMMAND --help" in text)
    assert terminal.end() == 0
    assert bool(COLOUR.search(terminal.raw)) is coloured
