"""The table of the page's files: complete, small, readable, and without another host."""

from __future__ import annotations

import gzip
import re
from pathlib import Path

import pytest

from tests.support.processes import ROOT
from zv.viewer.http.static_files import TYPES, page_files

PAGE = ROOT / "services" / "zv" / "viewer" / "page"
FILES = {str(path.relative_to(PAGE)): path for path in sorted(PAGE.rglob("*.*"))}
MOST_BYTES = 85_000
"""Of the page, compressed: it has tables, plots, a graph, and an editor of zones and lines."""
MOST_LINES = 250
MOST_IN_A_FOLDER = 15
MOST_COLUMNS = {".js": 104, ".css": 280, ".html": 240, ".svg": 300}
NAMESPACE = "http://www.w3.org/2000/svg"
"""Names what SVG is; nobody asks for it."""


def test_the_table_has_each_file_under_its_path_with_type_and_tag() -> None:
    table = page_files()
    assert set(table) == set(FILES)
    assert {"index.html", "css/base.css", "js/main.js", "js/ui/elements.js"} <= set(table)
    for name, path in FILES.items():
        assert table[name].body == path.read_bytes()
        assert table[name].type == TYPES[path.suffix]
    assert len({file.tag for file in table.values()}) == len(table)


def test_no_name_in_the_table_leads_out_of_the_folder() -> None:
    for name in page_files():
        assert re.fullmatch(r"([a-z]+/)*[a-z_]+\.[a-z]+", name), name


def test_all_files_together_are_sent_as_less_than_85_kb() -> None:
    files = page_files()
    assert all(gzip.decompress(file.compressed) == file.body for file in files.values())
    assert sum(len(file.compressed) for file in files.values()) < MOST_BYTES


def test_no_folder_has_more_than_15_files() -> None:
    for folder in {file.parent for file in FILES.values()}:
        assert len(list(folder.iterdir())) <= MOST_IN_A_FOLDER, folder


@pytest.mark.parametrize("file", FILES.values(), ids=FILES)
def test_a_file_can_be_read(file: Path) -> None:
    lines = file.read_text().expandtabs(2).splitlines()
    assert len(lines) <= MOST_LINES
    assert max(map(len, lines)) <= MOST_COLUMNS[file.suffix]


@pytest.mark.parametrize("file", FILES.values(), ids=FILES)
def test_a_file_names_no_other_host(file: Path) -> None:
    text = file.read_text().replace(NAMESPACE, "")
    assert re.findall(r"(?:https?:|wss?:)?//[a-z0-9.-]+\.[a-z]{2,}|@import|data:[a-z]", text) == []


def test_the_page_has_no_script_and_no_style_of_its_own() -> None:
    html = FILES["index.html"].read_text()
    assert re.findall(r"<style|\sstyle=|\son[a-z]+=|<script(?![^>]*\ssrc=)", html) == []
