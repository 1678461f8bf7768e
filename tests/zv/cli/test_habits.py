"""What a user expects of any command: help, near names, one line an error, colour where it fits."""

from __future__ import annotations

import os
import re
import shlex
import subprocess
import sys
import threading
from importlib.metadata import version

import click
import pytest

from docs.generate import entries
from tests.support.processes import ROOT, START_S, environment, run_program
from tests.support.terminal import Terminal
from tests.support.typist import type_zv
from zenoh_vision.cli import errors
from zenoh_vision.cli.command import CONNECTION_FLAGS, Command, Group, flags_behind_command
from zenoh_vision.cli.errors import FAULT_STATUS
from zenoh_vision.cli.flags import ConnectionSettings
from zenoh_vision.config.settings import flag_of
from zenoh_vision.errors import ToldToStop
from zv.cli import main
from zv.cli.main import COMMANDS, example, section
from zv.registry import BY_COMMAND

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
assert not {{"zenoh", "zenoh_vision.cli.flags"}} & set(sys.modules)
for words in {list(ENTRIES)!r}:
    helped(*words.split()[1:])
"""
    done = run_program([sys.executable, "-c", program])
    assert done.returncode == 0, done.stderr


def test_tools_that_decode_no_picture_load_no_opencv():
    # It takes 100 ms and 30 MB.
    modules = [
        "metrics.command", "topic.list", "topic.measure", "node.listing", "param.commands",
        "top.command", "doctor.command",
    ]  # fmt: skip
    program = f"""
import importlib, sys
for name in {modules!r}:
    importlib.import_module(f"zv.tools.{{name}}")
    print(name, {{"cv2", "numpy", "av"}} & set(sys.modules))
"""
    done = run_program([sys.executable, "-c", program])
    assert done.stdout.splitlines() == [f"{name} set()" for name in modules]
    assert done.stderr == ""


@pytest.mark.parametrize("command", ["camera", "view", "router"])
def test_garbage_collections_do_not_visit_what_a_service_imports(command: str):
    # A full collection that visits all of it delays a frame by 20 ms.
    module = f"zv.{BY_COMMAND[command]}.service"
    flags = (
        ["--listen", "tcp/127.0.0.1:0"] if command == "router" else ["--connect", "tcp/127.0.0.1:1"]
    )
    program = f"""
import gc, os, sys
def freeze():
    print({module!r} in sys.modules, flush=True)
    os._exit(0)
gc.freeze = freeze
sys.argv = ["zv", {command!r}, *{flags!r}]
from zv.cli.main import main
main()
"""
    done = run_program([sys.executable, "-c", program])
    assert (done.stdout, done.stderr) == ("True\n", "")


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
        (
            ["trakker"],
            "zv: no such command 'trakker'; did you mean tracker or track? see zv --help",
        ),
        (["xyz"], "zv: no such command 'xyz'; see zv --help"),
        (["play", "run.mcap"], "zv: no such command 'play'; did you mean bag play? see zv --help"),
        (["echo"], "zv: no such command 'echo'; did you mean topic echo? see zv --help"),
        (["camera", "--bogus"], "zv: no such option: --bogus; see zv camera --help"),
        (
            ["camera", "--reopen-mix", "1"],
            "zv: no such option: --reopen-mix; did you mean --reopen-min or --reopen-max? "
            "see zv camera --help",
        ),
        (
            ["camera", "--sorce", "0"],
            "zv: no such option: --sorce; did you mean --source? see zv camera --help",
        ),
        (["toppic"], "zv: no such command 'toppic'; did you mean topic or top? see zv --help"),
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


@pytest.mark.parametrize("flags", [[], ["--debug"]], ids=["", "debug"])
@pytest.mark.parametrize(
    ("arguments", "status"),
    [
        (["edge", "--sigma", "99"], 2),
        (["edge", "--config", "missing.toml"], 3),
        (["top", "--zenoh-config", "missing.json5"], 3),
        (["topic", "list", "--connect", "tcp/127.0.0.1:1", "--timeout", "100ms"], 4),
        (["param", "load", "camera_front", "missing.toml"], 3),
        (["up", "missing.toml"], 3),
        (["doctor", "--expect", "missing.toml"], 3),
    ],
    ids=lambda value: value[0] if isinstance(value, list) else "",
)
def test_an_error_of_the_users_is_one_line_with_debug_too(
    arguments: list[str], status: int, flags: list[str]
):
    done = zv(*arguments, *flags)
    assert (done.returncode, done.stdout) == (status, "")
    (line,) = done.stderr.splitlines()
    assert line.startswith("zv: ")


@pytest.mark.parametrize("flags", [[], ["--debug"]], ids=["", "debug"])
@pytest.mark.parametrize(
    "error", [ToldToStop("told to stop"), KeyboardInterrupt()], ids=["in a wait", "in our code"]
)
def test_ctrl_c_ends_with_0_and_says_nothing_with_debug_too(
    error: BaseException,
    flags: list[str],
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
):
    def interrupted() -> int:
        raise error

    monkeypatch.setattr(main, "run", interrupted)
    monkeypatch.setattr(sys, "argv", ["zv", "top", *flags])
    monkeypatch.setattr(threading, "excepthook", threading.excepthook)
    with pytest.raises(SystemExit) as ended:
        main.main()
    assert ended.value.code == 0
    assert capsys.readouterr() == ("", "")


def test_ctrl_c_while_zv_is_loaded_shows_no_traceback():
    program = (
        "import os, signal, sys\n"
        "import zv.__main__ as entry\n"
        "class Interrupted:\n"
        "    def find_spec(self, name, *_):\n"
        "        if name == 'zv.cli.main': os.kill(os.getpid(), signal.SIGINT)\n"
        "sys.meta_path.insert(0, Interrupted())\n"
        "entry.main()"
    )
    done = run_program([sys.executable, "-c", program])
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")


# Flags before the command


@pytest.mark.parametrize("flag", ["-h", "--help"])
@pytest.mark.parametrize("words", ["", "topic", "topic echo", "camera", "completion"])
def test_help_has_a_short_flag(words: str, flag: str):
    done = zv(*words.split(), flag)
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.startswith(f"Usage: zv {words}".rstrip())
    assert re.search(r"^  -h, --help +\w", done.stdout, re.MULTILINE)


def test_version_prints_the_version_of_the_distribution():
    done = zv("--version")
    first, licence = done.stdout.splitlines()
    assert (done.returncode, first) == (0, f"zv {version('zenoh-vision')}")
    assert licence.startswith(
        "licence: Apache-2.0, except the weights of the edge detector learned"
    )


@pytest.mark.parametrize(
    ("typed", "meant"),
    [
        ("--connect X topic list --json", "topic --connect X list --json"),
        ("--connect=X --timeout 5s up", "up --connect=X --timeout 5s"),
        ("--debug --namespace lab list", "list --debug --namespace lab"),
        ("list --connect X", "list --connect X"),
        ("--connect X", "--connect X"),
        ("--connect X --help", "--connect X --help"),
        ("--bogus list", "--bogus list"),
        ("", ""),
    ],
)
def test_the_flags_of_the_connection_may_stand_before_a_command(typed: str, meant: str):
    assert flags_behind_command(typed.split()) == meant.split()


@pytest.mark.parametrize(
    "typed",
    [
        "--connect tcp/127.0.0.1:1 --timeout 100ms topic list",
        "topic --connect tcp/127.0.0.1:1 --timeout 100ms list",
        "--connect tcp/127.0.0.1:2 topic list --connect tcp/127.0.0.1:1 --timeout 100ms",
    ],
)
def test_a_flag_before_the_command_is_used_and_one_behind_it_overrides_it(typed: str):
    done = zv(*typed.split())
    assert done.returncode == 4
    assert "no Zenoh router at tcp/127.0.0.1:1 within 0.1 s; start one" in done.stderr


def test_the_flags_before_a_command_are_those_of_the_connection():
    assert list(CONNECTION_FLAGS) == [flag_of(name) for name in ConnectionSettings.model_fields]


# Texts


@pytest.mark.parametrize("words", ENTRIES)
def test_help_is_for_people(words: str):
    text = ENTRIES[words].get_help(click.Context(ENTRIES[words], info_name=words))
    told = " ".join(text.split())
    for unwanted in ("^[", "]+", "(a list", "<bool>", "(a text)", "...)", " /--", "2m; )", "None"):
        assert unwanted not in told
    below = text.partition("\n\n")[2]  # the line of usage has the dots of arguments that repeat
    assert not re.search(r"[a-z]\.\.\.$", below, re.MULTILINE), "a sentence is cut"


@pytest.mark.parametrize("words", ENTRIES)
def test_each_example_is_one_line_of_its_own(words: str):
    for line in ENTRIES[words].examples:
        assert "\n" not in line
        assert line.startswith("zv ")


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
