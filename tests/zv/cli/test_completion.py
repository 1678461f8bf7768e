"""Shell completion: what the shells ask, what they are told, that it loads nothing heavy."""

from __future__ import annotations

import ast
import re
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.support.processes import ROOT, run_program
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
        pytest.param("zv tracke", ["tracker"], id="a command begun"),
        pytest.param("zv xyz", [], id="no such command"),
        pytest.param("zv play ", list(COMMANDS), id="a command without its group"),
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
    assert completions("zsh", "zv tracke").splitlines() == ["plain", "tracker", summary]


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


OF_THE_REPOSITORY = re.compile(
    r"\b(docs|examples|tests|benchmarks|configs|services|common)/|\.md\b"
)
OF_THE_USER = {
    "configs/up.toml",  # used if it is there; named with "of this folder" otherwise
    "launch file; default: configs/up.toml of this folder, or else the built-in one",
    "no folder configs/ here and no file given: nothing to check",
    "configuration files to check: of a service, launch files (.toml), of Zenoh (.json5); "
    "default: those in the folder configs/ here, if there is one",
}
"""What a user may have in the folder that a command is called in."""

FILES = sorted(path for folder in ("services", "common") for path in (ROOT / folder).rglob("*.py"))


def texts(path: Path) -> Iterator[str]:
    """Yield the texts in a file's code, which may be printed: all but docstrings."""
    tree = ast.parse(path.read_text())
    alone = {
        id(node.value)
        for node in ast.walk(tree)
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)
    }
    for node in ast.walk(tree):
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in alone:
            yield node.value


def test_no_text_names_a_file_of_the_repository():
    assert FILES
    found = [
        (str(path.relative_to(ROOT)), text)
        for path in FILES
        for text in texts(path)
        if OF_THE_REPOSITORY.search(text) and text not in OF_THE_USER
    ]
    assert found == []
