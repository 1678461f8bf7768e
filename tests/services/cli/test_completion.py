"""Shell completion: what the shells ask, what they are told, and that it loads nothing heavy."""

from __future__ import annotations

import subprocess
import sys

import pytest

from services.cli.main import COMMANDS
from tests.processes import ROOT, START_S, environment
from tests.typist import type_zv


def question(shell: str, typed: str) -> dict[str, str]:
    """Return the variables with which the shell's script asks.

    Args:
        shell: bash, zsh or fish.
        typed: The line so far, with the cursor at its end.
    """
    words = typed.split(" ")
    return {
        "_ZV_COMPLETE": f"complete_{shell}",
        "COMP_WORDS": "\n".join(words),
        "COMP_CWORD": str(len(words) - 1),
        "_TYPER_COMPLETE_ARGS": typed,
        "_TYPER_COMPLETE_FISH_ACTION": "get-args",
    }


def completions(shell: str, typed: str) -> str:
    """Ask as the shell's script does, and return the answer."""
    done = type_zv([], **question(shell, typed))
    assert (done.returncode, done.stderr) == (0, "")
    return done.stdout


def in_bash(typed: str) -> list[str]:
    return completions("bash", typed).split()


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
        pytest.param("zv camera --source ", [], id="left to the shell, which offers files"),
    ],
)
def test_bash_is_told(typed: str, expected: list[str]):
    assert in_bash(typed) == expected


def test_all_options_of_a_command_are_offered():
    offered = in_bash("zv metrics --")
    assert {"--listen", "--gone", "--json", "--connect", "--debug", "--help"} <= set(offered)
    assert all(line.startswith("--") for line in offered)


def test_zsh_is_told_with_descriptions():
    assert '"tracker":"Publish the largest moving object' in completions("zsh", "zv tra")


def test_fish_is_told_one_completion_a_line_however_long_its_description():
    lines = completions("fish", "zv metrics --").splitlines()
    assert [line.split("\t")[0] for line in lines] == in_bash("zv metrics --")


def test_to_offer_the_commands_none_of_them_is_loaded():
    program = (
        "import sys, atexit, services.cli.main as m\n"
        "atexit.register(lambda: print([name for name in sys.modules if name in "
        "('zenoh', 'cv2', 'numpy', 'services.cli.options', 'services.cli.tools')]))\n"
        "m.main()"
    )
    done = subprocess.run(
        [sys.executable, "-c", program],
        capture_output=True,
        text=True,
        cwd=ROOT,
        env={**environment(), **question("bash", "zv ")},
        timeout=START_S,
        check=True,
    )
    *offered, loaded = done.stdout.splitlines()
    assert offered == list(COMMANDS)
    assert loaded == "[]"


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_the_script_of_a_shell_is_printed_and_begins_with_what_it_must(shell: str):
    done = type_zv(["completion", shell])
    first = {"bash": "_zv_completion() {", "zsh": "#compdef zv", "fish": "complete --command zv"}
    assert done.stdout.startswith(first[shell])
    assert "_ZV_COMPLETE=complete_" + shell in done.stdout
