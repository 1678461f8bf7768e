"""Pictures as text for terminals: what is drawn is what was given."""

from __future__ import annotations

import base64
import re
import sys

import cv2
import numpy as np
import pytest

from zv.tools.topic import terminal_picture
from zv.tools.topic.terminal_picture import blocks, drawn, kitty, sixel, supported_form


def test_half_blocks_have_the_upper_pixel_as_ink_and_the_lower_as_paper():
    bgr = np.array([[[1, 2, 3]], [[4, 5, 6]], [[7, 8, 9]]], np.uint8)
    assert blocks(bgr) == (
        "\x1b[38;2;3;2;1;48;2;6;5;4m\u2580\x1b[0m\n\x1b[38;2;9;8;7;48;2;0;0;0m\u2580\x1b[0m"
    )


def test_kittys_parts_are_a_png_together():
    rng = np.random.default_rng(1)
    bgr = rng.integers(0, 255, (60, 80, 3), np.uint8)
    parts = re.findall("\x1b_G([^;]+);([^\x1b]*)\x1b\\\\", kitty(bgr))
    assert parts[0][0] == "a=T,f=100,q=2,m=1"
    assert [control for control, _ in parts[1:]] == ["m=1"] * (len(parts) - 2) + ["m=0"]
    assert max(len(data) for _, data in parts) <= 4096
    png = base64.b64decode("".join(data for _, data in parts))
    assert np.array_equal(cv2.imdecode(np.frombuffer(png, np.uint8), 1), bgr)


def decoded(text: str) -> np.ndarray:
    """Return the picture of a Sixel, by the rules of the manual."""
    width, height, data = re.fullmatch('\x1bP0;1q"1;1;(\\d+);(\\d+)(.*)\x1b\\\\', text).groups()
    picture = np.zeros((int(height), int(width), 3), np.uint8)
    palette: dict[str, list[int]] = {}
    x = top = 0
    colour = ""
    for number, rgb, count, character, other in re.findall(
        r"#(\d+)(?:;2;(\d+;\d+;\d+))?|(?:!(\d+))?([?-~])|([$-])", data
    ):
        if rgb:
            palette[number] = [round(255 * int(each) / 100) for each in rgb.split(";")][::-1]
        elif number:
            colour = number
        elif other:
            x, top = 0, top + 6 * (other == "-")
        else:
            for _ in range(int(count or 1)):
                for bit in range(6):
                    if ord(character) - 63 >> bit & 1:
                        picture[top + bit, x] = palette[colour]
                x += 1  # noqa: SIM113 - it begins again with each row
    return picture


@pytest.mark.parametrize("size", [(13, 17), (6, 1), (1, 40)])
def test_a_sixel_is_the_picture_to_half_a_level_of_its_palette(size: tuple[int, int]):
    rng = np.random.default_rng(2)
    bgr = cv2.GaussianBlur(rng.integers(0, 255, (*size, 3), np.uint8), (0, 0), 2)
    found = decoded(sixel(bgr))
    assert found.shape == bgr.shape
    assert np.abs(found.astype(int) - bgr).max() <= 27  # of levels that are 51 apart


def test_a_picture_fits_into_the_terminal_with_its_shape():
    bgr = np.zeros((100, 400, 3), np.uint8)
    lines = drawn(bgr, "blocks", 40, 20).split("\n")
    assert (len(lines), lines[0].count("\u2580")) == (5, 40)
    assert '"1;1;400;100' in drawn(bgr, "sixel", 80, 24)
    assert '"1;1;200;50' in drawn(bgr, "sixel", 20, 24)


@pytest.mark.parametrize(
    ("answer", "form"),
    [
        ("\x1b_Gi=31;OK\x1b\\\x1b[?62;4c", "kitty"),
        ("\x1b[?62;4;22c", "sixel"),
        ("\x1b_Gi=31;EINVAL\x1b\\\x1b[?62;22;4c", "sixel"),
        ("\x1b[?4c", "blocks"),  # the first number is the class of the terminal
        ("\x1b[?1;2c", "blocks"),
        ("", "blocks"),
    ],
)
def test_the_form_is_what_the_terminal_says_that_it_can(
    monkeypatch: pytest.MonkeyPatch, answer: str, form: str
):
    monkeypatch.setattr(terminal_picture, "_asked", lambda _: answer)
    for stream in (sys.stdin, sys.stdout):
        monkeypatch.setattr(stream, "isatty", lambda: True)
    assert supported_form() == form


def test_without_a_terminal_blocks_are_drawn():
    assert supported_form() == "blocks"
