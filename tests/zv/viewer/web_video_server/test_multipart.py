"""What programs and browsers get of a stream, by its bytes."""

from __future__ import annotations

from dataclasses import replace

import pytest

from tests.support.headers import header
from zv.viewer.streams.rendering import EncodedPicture
from zv.viewer.web_video_server.multipart import BrowserParts, ProgramParts, parts_for

HEADER = header(7, 1790000000123456789, stamp_ns=1790000000200000000)
LINE = b"--zenoh-vision-picture\r\n"
JPEG_BEGUN = LINE + b"Content-Type: image/jpeg\r\n\r\n"


def picture(payload: bytes, mime: str = "image/jpeg") -> EncodedPicture:
    return EncodedPicture("vision/front/image/compressed", HEADER, payload, mime, 640, 480, 3, 0)


@pytest.mark.parametrize(
    ("accept", "kind"),
    [
        ("image/avif,image/webp,image/apng,image/svg+xml,image/*,*/*;q=0.8", BrowserParts),
        ("image/avif,image/webp,*/*", BrowserParts),
        (
            "text/html,application/xhtml+xml,application/xml;q=0.9,image/avif,*/*;q=0.8",
            BrowserParts,
        ),
        ("*/*", ProgramParts),
        ("", ProgramParts),
    ],
    ids=["Chromium's img", "Firefox's img", "a tab", "curl", "nothing"],
)
def test_browsers_are_told_by_what_they_accept(accept: str, kind: type) -> None:
    assert isinstance(parts_for({"Accept": accept}), kind)
    assert isinstance(parts_for({}), ProgramParts)


def test_a_program_gets_a_whole_head_and_at_once_the_boundary_behind_the_picture() -> None:
    parts = ProgramParts()
    assert parts.begin == LINE
    assert parts.part(picture(b"JPEG")) == (
        b"Content-Type: image/jpeg\r\nContent-Length: 4\r\nX-Timestamp: 1790000000.200000000\r\n"
        b"X-Epoch: 1790000000123456789\r\nX-Seq: 7\r\n\r\nJPEG\r\n" + LINE
    )
    ended = replace(picture(b"JPEG"), ended_ns=5)
    assert b"X-Seq: 7\r\nX-Ended-Ns: 5\r\n\r\n" in parts.part(ended)


def test_a_browser_gets_the_head_of_the_next_part_at_once_too() -> None:
    parts = BrowserParts()
    sent = parts.begin + parts.part(picture(b"ONE"))
    assert sent == JPEG_BEGUN + b"ONE\r\n" + JPEG_BEGUN
    assert parts.part(picture(b"TWO")) == b"TWO\r\n" + JPEG_BEGUN


def test_a_part_that_was_begun_as_another_type_stays_empty() -> None:
    parts = BrowserParts()
    parts.part(picture(b"ONE"))
    png_begun = JPEG_BEGUN.replace(b"jpeg", b"png")
    assert parts.part(picture(b"TWO", "image/png")) == (
        b"\r\n" + png_begun + b"TWO\r\n" + png_begun
    )


@pytest.mark.parametrize("kind", [ProgramParts, BrowserParts])
def test_what_a_picture_becomes_is_made_once_for_all_of_a_kind(
    kind: type[ProgramParts | BrowserParts],
) -> None:
    one, other, shown = kind(), kind(), picture(b"JPEG")
    for parts in (one, other):
        parts.part(picture(b"BEFORE"))
    assert one.part(shown) is other.part(shown)
