"""The library and the command work beside a user's folders, whatever those are called."""

from __future__ import annotations

import pkgutil
import sys
from pathlib import Path

import pytest

import zenoh_vision
import zv
from tests.support.processes import ROOT, run_program

INNER = {
    module.name
    for package in (zenoh_vision, zv)
    for module in pkgutil.iter_modules(package.__path__)
}
PLANTED = sorted({"common", "services", "configs", "tests", "examples"} | INNER - {"__main__"})
"""Our top-level folders, and each name within our two packages, as someone else's."""

SCRIPT = """
from zenoh_vision import Connection, Frame, Node
import common, services

assert common.THEIRS and services.THEIRS
print(Node.__module__, Frame.__name__, Connection().connect)
"""
ZV = Path(sys.executable).with_name("zv")


@pytest.fixture
def home(tmp_path: Path) -> Path:
    """A user's folder with packages of every name that might be taken for ours."""
    for name in PLANTED:
        (tmp_path / name).mkdir()
        (tmp_path / name / "__init__.py").write_text("THEIRS = True\n")
    return tmp_path


def run(home: Path, folder: Path, *words: object) -> str:
    """Run a program in a folder, with the user's folder on PYTHONPATH as every ROS user has one."""
    done = run_program(words, folder=folder, PYTHONPATH=str(home))
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.mark.parametrize("place", ["home", "elsewhere"])
def test_a_script_imports_the_library_beside_such_folders_or_with_them_on_the_path(
    home: Path, tmp_path_factory: pytest.TempPathFactory, place: str
):
    folder = home if place == "home" else tmp_path_factory.mktemp("elsewhere")
    (folder / "script.py").write_text(SCRIPT)
    path = Path("/nowhere") if place == "home" else home
    assert run(path, folder, sys.executable, "script.py").startswith("zenoh_vision.")


@pytest.mark.parametrize("command", [[ZV], [sys.executable, "-m", "zv"]], ids=["zv", "python -m"])
@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--help"], "camera"),
        (["camera", "--help"], "--source"),
        (["schema", "Centroid"], '"box"'),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, list) else "",
)
def test_the_command_runs_there(home: Path, command: list[object], arguments: list[str], said: str):
    assert said in run(home, home, *command, *arguments)


def test_of_our_folders_only_two_packages_can_be_imported():
    words = [sys.executable, "-c", "import common.zenoh_vision"]
    found = run_program(words, folder=Path("/"), PYTHONPATH="/nowhere")
    assert "No module named 'common'" in found.stderr
    assert (ROOT / "common" / "zenoh_vision").is_dir()
