"""What a user expects of any command: help, near names, one line an error, colour where it fits."""

from __future__ import annotations

import os
import re
import shlex
import subprocess
import sys
import threading

import pytest

from tests.support.processes import ROOT, START_S, environment, run_program
from tests.support.terminal import Terminal
from tests.support.typist import type_zv
from zenoh_vision.errors import ConfigurationError, ToldToStop
from zv.cli import errors
from zv.cli.command import Command, Group
from zv.cli.errors import FAULT_STATUS
from zv.cli.generate import entries
from zv.cli.main import COMMANDS, example, section

HEAVY = {
    "av",
    "cv2",
    "numpy",
    "prometheus_client",
    "psutil",
    "simplejpeg",
    "zenoh",
}
"""What takes long to load, and what no help needs."""

COLOUR = re.compile(r"\x1b\[[0-9;]*\b(3[0-7]|9[0-7]|38;[0-9;]+)m")


def zv(*arguments: str, **variables: str) -> subprocess.CompletedProcess[str]:
    return type_zv(arguments, **variables)


ENTRIES = entries()
SINGLE = [words for words, command in ENTRIES.items() if isinstance(command, Command)]


# Help


def test_zv_alone_shows_the_commands_in_groups_with_examples():
    done = zv()
    assert (done.returncode, done.stderr) == (0, "")
    headings = [section(name) for name in COMMANDS]
    places = [done.stdout.index(f"\n{heading}:\n") for heading in dict.fromkeys(headings)]
    assert places == sorted(places)
    assert {"Services", "Tools"} < set(headings)
    for name in COMMANDS:
        assert re.search(rf"^  {name} +\w", done.stdout, re.MULTILINE)
    below = done.stdout.partition("Examples:")[2].split("\n")
    assert [line.strip() for line in below[1:3]] == ["zv up", example("camera")]


@pytest.mark.parametrize("words", SINGLE)
def test_the_help_of_a_command_has_an_example_that_parses(words: str):
    examples = [shlex.split(line, comments=True) for line in ENTRIES[words].examples]
    assert examples, "no example"
    for given in examples:
        arguments = given[: given.index(">")] if ">" in given else given
        command, rest = command_of(arguments)
        with command.make_context(words, rest):
            pass


def command_of(given: list[str]) -> tuple[Command | Group, list[str]]:
    """Return the command that a line calls, and its arguments."""
    for count in (3, 2):
        if " ".join(given[:count]) in ENTRIES:
            return ENTRIES[" ".join(given[:count])], given[count:]
    raise AssertionError(f"no such command: {given}")


def test_help_loads_nothing_that_takes_long():
    # One process for all commands: each is loaded and its help written.
    program = f"""
import contextlib, io, sys
from zv.cli.main import COMMANDS, run
def helped(*words):
    sys.argv = ["zv", *words, "--help"]
    with contextlib.redirect_stdout(io.StringIO()) as text:
        assert run() == 0
    assert "Usage" in text.getvalue()
    loaded = {HEAVY!r} & set(sys.modules)
    assert not loaded, (words, loaded)
helped()
assert not {{"zenoh", "zv.cli.flags"}} & set(sys.modules)
for words in {list(ENTRIES)!r}:
    helped(*words.split()[1:])
"""
    done = run_program([sys.executable, "-c", program])
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize(
    "words",
    ["", "--help", "topic", "topic list --help", "completion bash", "schema Centroid"],
    ids=lambda words: words or "zv alone",
)
def test_a_reader_that_has_had_enough_is_no_error(words: str):
    # As `| head -1` that is gone before the first line: a write finds the pipe closed.
    reading, writing = os.pipe()
    os.close(reading)
    try:
        done = subprocess.run(
            [sys.executable, "-m", "zv", *words.split()],
            stdout=writing,
            stderr=subprocess.PIPE,
            text=True,
            cwd=ROOT,
            env=environment(),
            timeout=START_S,
            check=False,
        )
    finally:
        os.close(writing)
    assert (done.returncode, done.stderr) == (0, "")


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
        (["edge", "x"], "zv: got unexpected extra argument (x); see zv edge --help"),
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
        "import sys, zv.edge.service as edge, zv.cli.main as cli\n"
        "def run(*_): raise KeyError('nobody\\nforesaw')\n"
        "edge.run = run\n"
        f"sys.argv = {['zv', 'edge', *flags]!r}\n"
        "cli.main()"
    )
    return run_program([sys.executable, "-c", program])


def test_a_fault_of_ours_is_70_and_one_line_that_says_so():
    done = surprise()
    assert (done.returncode, done.stdout) == (FAULT_STATUS, "")
    assert done.stderr == (
        "zv: unexpected KeyError: 'nobody\\nforesaw'; "
        "this is a bug in zv, --debug shows the traceback\n"
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
    monkeypatch.setattr(threading, "excepthook", errors.tell_end_of_thread)
    thread = threading.Thread(target=lambda: 1 // 0, name="reader")
    thread.start()
    thread.join()
    assert capsys.readouterr().err == (
        "zv: in thread reader: unexpected ZeroDivisionError: integer division or modulo by zero; "
        "this is a bug in zv, --debug shows the traceback\n"
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
    assert errors.tell(error, debug=False) == status
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
