"""The page's files: small, readable, without a step in between, and without another host."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
from pathlib import Path

import pytest

from tests.processes import ROOT

PAGE = ROOT / "services" / "viewer" / "page"
FILES = sorted(PAGE.iterdir())
SCRIPTS = sorted((Path(__file__).parent / "page").glob("*.test.js"))
MOST_BYTES = 150_000
MOST_LINES = 250
MOST_COLUMNS = {".js": 104, ".css": 280, ".html": 240, ".svg": 300}
NAMESPACE = "http://www.w3.org/2000/svg"
"""Names what SVG is; nobody asks for it."""


def test_all_files_together_are_under_150_kb() -> None:
    assert sum(file.stat().st_size for file in FILES) < MOST_BYTES


@pytest.mark.parametrize("file", FILES, ids=lambda file: file.name)
def test_a_file_can_be_read(file: Path) -> None:
    lines = file.read_text().expandtabs(2).splitlines()
    assert len(lines) <= MOST_LINES
    assert max(map(len, lines)) <= MOST_COLUMNS[file.suffix]


@pytest.mark.parametrize("file", FILES, ids=lambda file: file.name)
def test_a_file_names_no_other_host(file: Path) -> None:
    text = file.read_text().replace(NAMESPACE, "")
    assert re.findall(r"(?:https?:|wss?:)?//[a-z0-9.-]+\.[a-z]{2,}|@import|data:[a-z]", text) == []


def test_the_page_has_no_script_and_no_style_of_its_own() -> None:
    html = (PAGE / "index.html").read_text()
    assert re.findall(r"<style|\sstyle=|\son[a-z]+=|<script(?![^>]*\ssrc=)", html) == []


def test_every_file_that_is_named_is_there_and_every_file_is_named() -> None:
    named = {"index.html"}
    for file in FILES:
        text = file.read_text()
        named |= set(re.findall(r'from "\./([^"]+)"', text))
        named |= set(re.findall(r'"/page/([^"]+)"', text))
    assert named == {file.name for file in FILES}


def test_every_element_that_a_module_asks_for_is_in_the_page() -> None:
    ids = set(re.findall(r'\sid="([^"]+)"', (PAGE / "index.html").read_text()))
    asked = {
        name
        for file in PAGE.glob("*.js")
        for name in re.findall(r'byId\("([^"]+)"\)', file.read_text())
    }
    assert asked <= ids


@pytest.mark.parametrize("script", SCRIPTS, ids=lambda script: script.name.partition(".")[0])
def test_modules_that_need_no_document(script: Path, tmp_path: Path) -> None:
    """Run a module's own tests in Node; the modules stand beside them, as in the browser."""
    node = shutil.which("node")
    if node is None:
        pytest.skip("no node, which runs JavaScript without a browser")
    for module in (*PAGE.glob("*.js"), script):
        shutil.copy(module, tmp_path)
    (tmp_path / "package.json").write_text(json.dumps({"type": "module"}))
    command = [node, "--test", str(tmp_path / script.name)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
