"""Shell completion: what the shells ask, what they are told, and that it loads nothing heavy."""

from __future__ import annotations

import sys

import pytest

from tests.support.processes import run_program
from tests.support.typist import type_zv
from zv.cli.main import COMMANDS
from zv.registry import SERVICES


def question(shell: str, typed: str) -> dict[str, str]:
    """Return the variables with which the shell's script asks.

    Args:
        shell: bash, zsh or fish.
        typed: The line so far, with the cursor at its end.
    """
    words = typed.split(" ")
    return {
        "_ZV_COMPLETE": f"{shell}_complete",
        "COMP_WORDS": typed,
        "COMP_CWORD": words[-1] if shell == "fish" else str(len(words) - 1),
    }


def completions(shell: str, typed: str) -> str:
    """Ask as the shell's script does, and return the answer."""
    done = type_zv([], **question(shell, typed))
    assert (done.returncode, done.stderr) == (0, "")
    return done.stdout


def in_bash(typed: str) -> list[str]:
    return [line.removeprefix("plain,") for line in completions("bash", typed).split()]


@pytest.mark.parametrize(
    ("typed", "expected"),
    [
        pytest.param("zv ", list(COMMANDS), id="all commands"),
        pytest.param("zv tra", ["tracker"], id="a command begun"),
        pytest.param("zv xyz", [], id="no such command"),
        pytest.param("zv tracker --hist", ["--history"], id="an option"),
        pytest.param("zv camera --no-l", ["--no-loop"], id="the other half of a switch"),
        pytest.param("zv camera --flip ", ["none", "horizontal", "vertical", "both"], id="values"),
        pytest.param("zv edge --aperture ", ["3", "5", "7"], id="numbers to choose from"),
        pytest.param("zv edge --format j", ["jpeg"], id="a value begun"),
        pytest.param("zv completion ", ["bash", "zsh", "fish"], id="an argument"),
        pytest.param("zv camera --source ", ["file,"], id="files, which the shell lists"),
    ],
)
def test_bash_completes(typed: str, expected: list[str]):
    assert in_bash(typed) == expected


def test_all_options_of_a_command_are_offered():
    offered = in_bash("zv metrics --")
    assert {"--listen", "--gone", "--json", "--connect", "--debug", "--help"} <= set(offered)
    assert all(line.startswith("--") for line in offered)


def test_zsh_is_told_with_descriptions():
    summary = SERVICES["tracker"].summary
    assert completions("zsh", "zv tra").splitlines() == ["plain", "tracker", summary]


def test_fish_is_told_one_completion_a_line_however_long_its_description():
    lines = completions("fish", "zv metrics --").splitlines()
    offered = [line.removeprefix("plain,").split("\t")[0] for line in lines]
    assert offered == in_bash("zv metrics --")


def test_to_offer_the_commands_none_of_them_is_loaded():
    program = (
        "import sys, atexit, zv.cli.main as m\n"
        "atexit.register(lambda: print([name for name in sys.modules if name in "
        "('zenoh', 'cv2', 'numpy', 'zenoh_vision.cli.flags', 'zv.cli.loading')]))\n"
        "m.main()"
    )
    done = run_program([sys.executable, "-c", program], **question("bash", "zv "))
    *offered, loaded = done.stdout.splitlines()
    assert offered == [f"plain,{name}" for name in COMMANDS]
    assert loaded == "[]"


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_the_script_of_a_shell_is_printed_and_begins_with_what_it_must(shell: str):
    done = type_zv(["completion", shell])
    first = {"bash": "_zv_completion() {", "zsh": "#compdef zv", "fish": "function _zv_completion;"}
    assert done.stdout.startswith(first[shell])
    assert f"_ZV_COMPLETE={shell}_complete" in done.stdout
