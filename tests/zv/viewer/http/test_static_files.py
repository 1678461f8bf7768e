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
MOST_BYTES = 100_000
"""Of the page, compressed: it has tables, plots, a graph, messages, and an editor of zones."""
NAMESPACE = "http://www.w3.org/2000/svg"
"""Names what SVG is; nobody asks for it."""


def without_comments(served: bytes, source: bytes) -> bool:
    """Tell whether each line is that of the source, or empty where that has only a comment."""
    is_comment = False
    for ours, theirs in zip(served.split(b"\n"), source.split(b"\n"), strict=True):
        text = theirs.strip()
        is_comment = is_comment or text.startswith(b"/*")
        if ours != (b"" if is_comment or text.startswith(b"//") else theirs):
            return False
        is_comment = is_comment and b"*/" not in text
    return True


def test_the_table_has_each_file_under_its_path_with_type_and_tag() -> None:
    table = page_files()
    assert set(table) == set(FILES)
    assert {"index.html", "css/base.css", "js/main.js", "js/ui/elements.js"} <= set(table)
    for name, path in FILES.items():
        if path.suffix in (".js", ".css"):
            assert without_comments(table[name].body, path.read_bytes())
        elif name != "index.html":
            assert table[name].body == path.read_bytes()
        assert table[name].type == TYPES[path.suffix]
    assert len({file.tag for file in table.values()}) == len(table)
    preloaded = re.findall(
        rb'<link rel="modulepreload" href="page/(.+?)">', table["index.html"].body
    )
    assert {name.decode() for name in preloaded} == {name for name in FILES if ".js" in name}


def test_no_name_in_the_table_leads_out_of_the_folder() -> None:
    for name in page_files():
        assert re.fullmatch(r"([a-z]+/)*[a-z_]+\.[a-z]+", name), name


def test_all_files_together_are_sent_as_less_than_100_kb() -> None:
    files = page_files()
    assert all(gzip.decompress(file.compressed) == file.body for file in files.values())
    assert sum(len(file.compressed) for file in files.values()) < MOST_BYTES


@pytest.mark.parametrize("file", FILES.values(), ids=FILES)
def test_a_file_names_no_other_host(file: Path) -> None:
    text = file.read_text().replace(NAMESPACE, "")
    assert re.findall(r"(?:https?:|wss?:)?//[a-z0-9.-]+\.[a-z]{2,}|@import|data:[a-z]", text) == []


def test_the_page_has_no_script_and_no_style_of_its_own() -> None:
    html = FILES["index.html"].read_text()
    assert re.findall(r"<style|\sstyle=|\son[a-z]+=|<script(?![^>]*\ssrc=)", html) == []
