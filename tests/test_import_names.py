"""The library and the command work beside a user's folders, whatever those are called."""

from __future__ import annotations

import os
import pkgutil
import subprocess
import sys
from pathlib import Path

import pytest

import zenoh_vision
import zv
from tests.support.processes import ROOT

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
    """A user's folder with a script, and packages of every name that might be taken for ours."""
    for name in PLANTED:
        (tmp_path / name).mkdir()
        (tmp_path / name / "__init__.py").write_text("THEIRS = True\n")
    (tmp_path / "script.py").write_text(SCRIPT)
    return tmp_path


def run(home: Path, folder: Path, *words: object) -> str:
    """Run a program in a folder, with the user's folder on PYTHONPATH as every ROS user has one."""
    own = {name: value for name, value in os.environ.items() if not name.startswith("ZV_")}
    done = subprocess.run(
        [str(word) for word in words],
        cwd=folder,
        env={**own, "PYTHONPATH": str(home)},
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_a_script_beside_such_folders_imports_the_library(home: Path):
    said = run(Path("/nowhere/on/PYTHONPATH"), home, sys.executable, "script.py")
    assert said.startswith("zenoh_vision.")


def test_a_script_elsewhere_imports_the_library_with_such_folders_on_the_path(
    home: Path, tmp_path_factory: pytest.TempPathFactory
):
    elsewhere = tmp_path_factory.mktemp("elsewhere")
    (elsewhere / "script.py").write_text(SCRIPT)
    assert run(home, elsewhere, sys.executable, "script.py").startswith("zenoh_vision.")


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
    found = subprocess.run(
        [sys.executable, "-c", "import common.zenoh_vision"],
        cwd="/",
        env={name: value for name, value in os.environ.items() if name != "PYTHONPATH"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert "No module named 'common'" in found.stderr
    assert (ROOT / "common" / "zenoh_vision").is_dir()
