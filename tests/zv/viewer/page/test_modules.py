"""The page's modules: which may import which, that all are used, and their own tests in Node."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
from graphlib import TopologicalSorter
from pathlib import Path

import pytest

from tests.support.processes import ROOT, need

PAGE = ROOT / "services" / "zv" / "viewer" / "page"
MODULES = PAGE / "js"
SCRIPTS = sorted(Path(__file__).parent.glob("*.test.js"))
LAYERS = (
    {""},  # the page as a whole: main.js and what stands beside it
    {"wall", "inspector", "panels"},
    {"export"},
    {"video"},
    {"model"},
    {"transport", "ui"},
)
"""Folders, top first: each imports from lower layers only, and not from one beside it."""

LEVELS = {folder: level for level, folders in enumerate(LAYERS) for folder in folders}
IMPORT = re.compile(r'^import \{([^}]+)\} from "(\.[^"]+)";$', re.MULTILINE)
EXPORT = re.compile(r"^export (?:async )?(?:class|const|function) (\w+)", re.MULTILINE)


def _folder(name: str) -> str:
    return name.rpartition("/")[0]


def _imports() -> dict[str, dict[str, set[str]]]:
    """Return for each module which names it imports from which others."""
    found: dict[str, dict[str, set[str]]] = {}
    for path in sorted(MODULES.rglob("*.js")):
        text = path.read_text()
        imported = {
            str((path.parent / other).resolve().relative_to(MODULES)): set(
                re.findall(r"\w+", names)
            )
            for names, other in IMPORT.findall(text)
        }
        assert len(imported) == len(re.findall(r"^\s*import\b|\bimport\(", text, re.MULTILINE))
        found[str(path.relative_to(MODULES))] = imported
    return found


IMPORTS = _imports()


def test_every_folder_has_its_layer() -> None:
    assert {_folder(module) for module in IMPORTS} == set(LEVELS)


@pytest.mark.parametrize("module", IMPORTS)
def test_a_module_imports_from_its_own_folder_and_from_lower_layers(module: str) -> None:
    for other in IMPORTS[module]:
        own, its = _folder(module), _folder(other)
        assert own == its or LEVELS[own] < LEVELS[its], f"{module} imports {other}"


def test_no_modules_import_each_other_in_a_circle() -> None:
    TopologicalSorter(IMPORTS).prepare()


def test_every_file_that_is_named_is_there_and_every_file_is_named() -> None:
    named = {other for imported in IMPORTS.values() for other in imported}
    named = {f"js/{module}" for module in named} | {"index.html"}
    for path in (PAGE / "index.html", *MODULES.rglob("*.js")):
        named |= set(re.findall(r'"page/([^"]+)"', path.read_text()))
    assert named == {str(path.relative_to(PAGE)) for path in PAGE.rglob("*.*")}


def test_every_import_is_exported_and_every_export_is_imported() -> None:
    imported = {
        (other, name) for one in IMPORTS.values() for other, names in one.items() for name in names
    }
    exported = {
        (module, name)
        for module in IMPORTS
        for name in EXPORT.findall((MODULES / module).read_text())
    }
    tested = {name for script in SCRIPTS for name in re.findall(r"\w+", script.read_text())}
    assert imported <= exported
    assert {(module, name) for module, name in exported - imported if name not in tested} == set()


def test_every_element_that_a_module_asks_for_is_in_the_page() -> None:
    ids = set(re.findall(r'\sid="([^"]+)"', (PAGE / "index.html").read_text()))
    asked = {
        name
        for module in IMPORTS
        for name in re.findall(r'byId\("([^"]+)"\)', (MODULES / module).read_text())
    }
    assert asked <= ids


@pytest.mark.parametrize("script", SCRIPTS, ids=lambda script: script.name.partition(".")[0])
def test_modules_that_need_no_document(script: Path, tmp_path: Path) -> None:
    """Run a layer's own tests in Node; the modules stand beside them, as in the browser."""
    node = need("node", "nodejs")
    shutil.copytree(MODULES, tmp_path, dirs_exist_ok=True)
    shutil.copy(script, tmp_path)
    (tmp_path / "package.json").write_text(json.dumps({"type": "module"}))
    command = [node, str(tmp_path / script.name)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
