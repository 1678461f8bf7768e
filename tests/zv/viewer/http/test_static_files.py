"""The page's files: complete, small, without another host, and nothing else is served."""

from __future__ import annotations

import gzip
import hashlib
import re
from collections.abc import Iterator

import pytest

from tests.support.processes import ROOT
from tests.support.viewer.client import get
from tests.support.viewer.serving import FakeNode, serving
from zv.viewer.http.access import SECURITY_HEADERS
from zv.viewer.http.static_files import TYPES, page_files

PAGE = ROOT / "services" / "zv" / "viewer" / "page"
FILES = {str(path.relative_to(PAGE)): path for path in sorted(PAGE.rglob("*.*"))}
OURS_BYTES = 100_000
"""Of the page, compressed: it has tables, plots, a graph, messages, and an editor of zones."""
MOST_BYTES = 125_000
"""With the library of plots."""
SUMS = {
    "vendor/uplot.js": "2d27e8ad3d228164525ce213f9dc716f39b4e3aee0cc773fb3491c96cf4921a2",
    "vendor/uplot.css": "df630c6a8d6f8eeaff264b50f73ce5b114f646ffd9a0bb74f049b0a00135fa04",
}
"""SHA-256 of uPlot 1.6.31 as its makers released it."""
NOTICE = "/*! https://github.com/leeoniya/uPlot (v1.6.31) */"
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
        if path.suffix in (".js", ".css") and name not in SUMS:
            assert without_comments(table[name].body, path.read_bytes())
        elif name != "index.html":
            assert table[name].body == path.read_bytes()
        assert table[name].type == TYPES[path.suffix]
    assert len({file.tag for file in table.values()}) == len(table)
    preloaded = re.findall(
        rb'<link rel="modulepreload" href="page/(.+?)">', table["index.html"].body
    )
    modules = {name for name in FILES if name.startswith("js/")}
    assert {name.decode() for name in preloaded} == modules


def test_what_others_wrote_is_unchanged_and_has_its_licence() -> None:
    vendored = {name: file.body for name, file in page_files().items() if "vendor" in name}
    assert {name: hashlib.sha256(body).hexdigest() for name, body in vendored.items()} == SUMS
    assert vendored["vendor/uplot.js"].startswith(NOTICE.encode())
    assert "uPlot 1.6.31" in (PAGE / "vendor" / "LICENSE").read_text()


def test_no_name_in_the_table_leads_out_of_the_folder() -> None:
    for name in page_files():
        assert re.fullmatch(r"([a-z]+/)*[a-z_]+\.[a-z]+", name), name


def test_all_files_together_are_sent_as_less_than_125_kb_and_ours_as_less_than_100() -> None:
    files = page_files()
    assert all(gzip.decompress(file.compressed) == file.body for file in files.values())
    sizes = {name: len(file.compressed) for name, file in files.items()}
    assert sum(sizes.values()) < MOST_BYTES
    assert sum(size for name, size in sizes.items() if name not in SUMS) < OURS_BYTES


def test_no_file_names_another_host() -> None:
    for name, file in FILES.items():
        text = file.read_text().replace(NAMESPACE, "").replace(NOTICE, "")
        found = re.findall(r"(?:https?:|wss?:)?//[a-z0-9.-]+\.[a-z]{2,}|@import|data:[a-z]", text)
        assert found == [], name


def test_the_page_has_no_script_and_no_style_of_its_own() -> None:
    html = FILES["index.html"].read_text()
    assert re.findall(r"<style|\sstyle=|\son[a-z]+=|<script(?![^>]*\ssrc=)", html) == []


ABSENT = (
    "/page/js", "/page/js/", "/page/js/nosuch.js", "/page/js/main.js/", "/page/main.js",
    "/page//js/main.js", "/page/js//main.js", "/page/js/main.js%00", "/page/js\\main.js",
    "/page/js/../../settings.py", "/page/js/%2e%2e/%2e%2e/settings.py",
    "/page/js/ui/..%2f..%2f..%2fservice.py", "/page/js/../../../../../../etc/passwd",
    "/page/__init__.py", "/page/JS/main.js",
)  # fmt: skip


@pytest.fixture(scope="module")
def port() -> Iterator[int]:
    """Of a server."""
    with serving(FakeNode()) as server:
        yield server._listening.getsockname()[1]


def test_every_file_is_served_with_its_type_its_tag_and_the_policy(port: int) -> None:
    for name, file in page_files().items():
        answer = get(port, f"/page/{name}")
        assert (answer.status, answer.body) == (200, file.body), name
        assert answer.headers["content-type"] == file.type
        for header, value in SECURITY_HEADERS.items():
            assert answer.headers[header.lower()] == value
        small = get(port, f"/page/{name}", Accept_Encoding="gzip, deflate, br")
        assert (small.body, small.headers["content-encoding"]) == (file.compressed, "gzip")
        assert small.headers["vary"] == answer.headers["vary"] == "Accept-Encoding"
        known = get(port, f"/page/{name}", If_None_Match=answer.headers["etag"])
        assert (known.status, known.body) == (304, b"")
    plain = get(port, "/page/js/main.js", Accept_Encoding="br, gzip;q=0")
    assert "content-encoding" not in plain.headers


def test_what_is_not_in_the_table_is_not_found_and_every_answer_keeps_browsers_safe(port: int):
    for path in ABSENT:
        assert get(port, path).status == 404, path
    for path in (*ABSENT, "/", "/snapshot", "/healthz", "/stream_viewer?topic=/front/image"):
        headers = get(port, path).headers
        policy = headers["content-security-policy"]
        assert policy.startswith("default-src 'none'; script-src 'self';")
        assert "frame-ancestors 'none'" in policy
        assert "unsafe" not in policy
        assert headers["x-content-type-options"] == "nosniff"
        assert headers["referrer-policy"] == "no-referrer"
        assert "aiohttp" not in headers["server"]
