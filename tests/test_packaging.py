"""The distribution's import names are its own: no other distribution ships them."""

import ast
import subprocess
import sys
import tomllib
from importlib.metadata import distributions
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent


def test_no_other_installed_distribution_ships_our_top_level_names():
    for distribution in distributions():
        if distribution.metadata["Name"] != "zenoh-vision":
            tops = {path.parts[0].removesuffix(".py") for path in distribution.files or ()}
            assert not tops & {"zenoh_vision", "zv"}, distribution.metadata["Name"]


def test_opencv_is_installed_once_and_headless():
    names = {distribution.metadata["Name"].lower() for distribution in distributions()}
    assert {name for name in names if name.startswith("opencv")} == {"opencv-python-headless"}


def test_a_wheel_cannot_be_uploaded_by_mistake():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    assert "Private :: Do Not Upload" in project["classifiers"]


def test_constraints_pin_every_runtime_dependency_and_name_no_index():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    lines = [
        line
        for line in (ROOT / "constraints.txt").read_text().splitlines()
        if line and not line.startswith("#")
    ]
    assert all(line.count("==") == 1 and "://" not in line for line in lines)
    pinned = {line.split("==")[0].lower() for line in lines}
    wanted = {dependency.split(">=")[0].lower() for dependency in project["dependencies"]}
    assert wanted <= pinned


@pytest.mark.parametrize("command", [["--help"], ["camera", "--help"]], ids=" ".join)
def test_help_imports_neither_cv2_nor_the_services(command: list[str]):
    program = (
        "import sys\n"
        f"sys.argv = ['zv', *{command!r}]\n"
        "from zv.cli.main import main\n"
        "try:\n    main()\nexcept SystemExit as end:\n    assert not end.code\n"
        "print({'cv2', 'av', 'zv.camera.service'} & set(sys.modules), file=sys.stderr)\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=True, cwd=ROOT
    )
    assert done.stderr.strip() == "set()"


def test_the_list_of_commands_needs_no_zenoh():
    program = (
        "import sys\n"
        "sys.argv = ['zv', '--help']\n"
        "from zv.cli.main import main\n"
        "try:\n    main()\nexcept SystemExit:\n    pass\n"
        "assert 'zenoh' not in sys.modules and 'cv2' not in sys.modules\n"
    )
    subprocess.run([sys.executable, "-c", program], check=True, capture_output=True, cwd=ROOT)


def test_no_module_has_a_vague_name_or_no_docstring():
    paths = sorted([*ROOT.glob("common/**/*.py"), *ROOT.glob("services/**/*.py")])
    vague = {"utils", "helpers", "helper", "manager", "misc"}
    assert paths
    assert [path for path in paths if vague & {path.stem, path.parent.name}] == []
    assert [path for path in paths if not ast.get_docstring(ast.parse(path.read_text()))] == []
