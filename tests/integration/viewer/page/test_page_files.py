"""The page's files are served from their table, in folders, and nothing else is."""

from __future__ import annotations

import gzip

import pytest

from tests.support.viewer.client import Viewer
from zv.viewer.http.access import SECURITY_HEADERS
from zv.viewer.http.static_files import page_files

ABSENT = (
    "/page/js", "/page/js/", "/page/js/nosuch.js", "/page/js/main.js/", "/page/main.js",
    "/page//js/main.js", "/page/js//main.js", "/page/js/main.js%00", "/page/js\\main.js",
    "/page/js/../../settings.py", "/page/js/%2e%2e/%2e%2e/settings.py",
    "/page/js/ui/..%2f..%2f..%2fservice.py", "/page/js/../../../../../../etc/passwd",
    "/page/__init__.py", "/page/JS/main.js",
)  # fmt: skip


def test_every_file_is_served_with_its_type_its_tag_and_the_policy(standing_viewer: Viewer) -> None:
    for name, file in page_files().items():
        answer = standing_viewer.get(f"/page/{name}")
        assert (answer.status, answer.body) == (200, file.body), name
        assert answer.headers["content-type"] == file.type
        for header, value in SECURITY_HEADERS.items():
            assert answer.headers[header.lower()] == value
        small = standing_viewer.get(f"/page/{name}", Accept_Encoding="br, gzip")
        assert (small.body, small.headers["content-encoding"]) == (file.compressed, "gzip")
        assert small.headers["vary"] == answer.headers["vary"] == "Accept-Encoding"
        known = standing_viewer.get(f"/page/{name}", If_None_Match=answer.headers["etag"])
        assert (known.status, known.body) == (304, b"")


def test_a_browser_gets_the_files_compressed_with_the_same_content(
    standing_viewer: Viewer,
) -> None:
    for name, file in page_files().items():
        answer = standing_viewer.get(f"/page/{name}", Accept_Encoding="gzip, deflate, br")
        assert answer.headers["content-encoding"] == "gzip"
        assert answer.headers["vary"] == "Accept-Encoding"
        assert gzip.decompress(answer.body) == file.body
    answer = standing_viewer.get("/page/js/main.js", Accept_Encoding="br, gzip;q=0")
    assert "content-encoding" not in answer.headers


@pytest.mark.parametrize("path", ABSENT)
def test_what_is_not_in_the_table_is_not_found(standing_viewer: Viewer, path: str) -> None:
    assert standing_viewer.get(path).status == 404
