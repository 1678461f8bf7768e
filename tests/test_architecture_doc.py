"""docs/architecture.md is true: its table of files is that of the imports, its names exist."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import pytest

from services.catalogue import SERVICES, command_of
from services.cli.main import COMMANDS

ROOT = Path(__file__).parent.parent
TEXT = (ROOT / "docs" / "architecture.md").read_text()
ROWS = dict(re.findall(r"^\| \[common/(\w+)\.py\].*\| ([^|]+) \|$", TEXT, re.MULTILINE))
MODULES = sorted(path.stem for path in ROOT.glob("common/*.py") if path.stem != "__init__")
EVERYTHING = "nearly all of the above"


def imports_of(module: str) -> set[str]:
    found = set()
    for node in ast.walk(ast.parse((ROOT / "common" / f"{module}.py").read_text())):
        if isinstance(node, ast.ImportFrom) and (node.module or "").split(".")[0] == "common":
            inside = node.module.partition(".")[2]
            found |= {inside} if inside else {alias.name for alias in node.names}
    return found


def test_every_module_of_common_has_its_row():
    assert sorted(ROWS) == MODULES


@pytest.mark.parametrize("module", MODULES)
def test_a_row_names_what_the_module_imports(module: str):
    if ROWS[module] == EVERYTHING:
        assert len(imports_of(module)) > len(MODULES) / 2
    else:
        assert set(ROWS[module].split(", ")) == (imports_of(module) or {"none"})


def test_a_module_stands_below_all_that_it_imports():
    order = list(ROWS)
    for module in order:
        assert imports_of(module) <= set(order[: order.index(module)]), module


def test_every_service_of_the_catalogue_is_a_folder_and_a_command():
    folders = {path.parent.name for path in (ROOT / "services").glob("*/service.py")} - {"up"}
    assert set(SERVICES) == folders
    assert set(map(command_of, SERVICES)) < set(COMMANDS)
