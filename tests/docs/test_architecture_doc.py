"""docs/architecture.md is true: its drawings name every package, and its names exist."""

from __future__ import annotations

import re
from pathlib import Path

from zv.cli.main import COMMANDS
from zv.registry import SERVICES, command_of

ROOT = Path(__file__).parents[2]
TEXT = (ROOT / "docs" / "architecture.md").read_text()
FRAME, PACKAGES = re.findall(r"^```\n(.*?)^```$", TEXT, re.MULTILINE | re.DOTALL)
SOURCES = [*ROOT.glob("common/zenoh_vision/**/*.py"), *ROOT.glob("services/zv/**/*.py")]
CODE = "".join(path.read_text() for path in SOURCES)


def children(folder: str) -> set[str]:
    """Return the packages and modules of a folder, but for the entry points of Python."""
    found = (path for path in (ROOT / folder).iterdir() if path.suffix in ("", ".py"))
    return {path.stem for path in found if not path.stem.startswith("__")}


def words_of(box: str) -> set[str]:
    """Return the words in one box of the drawing of packages."""
    begin = PACKAGES.index(f" {box} ")
    return set(re.findall(r"\w+", PACKAGES[begin : PACKAGES.index("└", begin)]))


def test_every_service_of_the_catalogue_is_a_folder_and_a_command():
    folders = {path.parent.name for path in (ROOT / "services/zv").glob("*/service.py")}
    assert set(SERVICES) == folders
    assert set(map(command_of, SERVICES)) < set(COMMANDS)


def test_the_drawing_of_packages_names_every_package_and_module():
    for folder in ("services/zv", "common/zenoh_vision"):
        assert children(folder) <= words_of(folder)


def test_the_files_in_the_drawing_of_a_frame_exist():
    files = re.findall(r"[a-z]+/[a-z_]+\.py", FRAME)
    assert len(files) >= 7
    for file in files:
        assert any(path.as_posix().endswith(f"/{file}") for path in SOURCES), file


def test_the_classes_that_the_page_names_exist():
    classes = re.findall(r"`([A-Z][a-z]+(?:[A-Z][a-z]+)*)`", TEXT)
    drawn = re.findall(r"\b[A-Z][a-z]+[A-Z]\w+", FRAME)
    assert len({*classes, *drawn}) >= 10
    for name in {*classes, *drawn}:
        assert re.search(rf"class {name}\b", CODE), name


def test_the_threads_that_the_page_names_are_started_under_these_names():
    table = TEXT.partition("## Threads")[2].partition("##")[0]
    names = re.findall(r"^\| (`.*?) \|", table, re.MULTILINE)
    assert len(names) >= 6
    for name in re.findall(r"`([a-z]+)", " ".join(names)):
        thread = rf'(?:name|thread_name_prefix)=f?"{name}'
        assert re.search(thread, CODE), name
