"""Draws pictures in a terminal: by Kitty's graphics protocol, as Sixel, or with block characters.

Sources: the documentation of Kitty's terminal graphics protocol; DEC, "VT330/VT340 Programmer
Reference Manual", chapter 14, Sixel graphics.
"""

from __future__ import annotations

import base64
import os
import select
import sys
import termios
import time
import tty
from collections.abc import Iterator
from typing import Final, Literal, get_args

import cv2
import numpy as np
from numpy.typing import NDArray

from zenoh_vision.image import codecs

Form = Literal["kitty", "sixel", "blocks"]
FORMS: Final = get_args(Form)
Bgr = NDArray[np.uint8]

ANSWER_S: Final = 0.5
CELL_PX: Final = (10, 20)
"""Assumed width and height of a character, where the terminal does not say: for Sixel."""

KITTY_CHUNK: Final = 4096
ASK_KITTY: Final = "\x1b_Gi=31,s=1,v=1,a=q,t=d,f=24;AAAA\x1b\\"
ASK_DEVICE: Final = "\x1b[c"
"""Asks for the device's attributes, which every terminal answers; 4 is Sixel."""

LEVELS: Final = 6
"""Levels of red, green and blue in a Sixel: 216 colours of the 256 that terminals have."""


def supported_form() -> Form:
    """Return the best form that the terminal on standard input and output draws."""
    if not (sys.stdin.isatty() and sys.stdout.isatty()):
        return "blocks"
    answer = _asked(ASK_KITTY + ASK_DEVICE)
    if "_Gi=31;OK" in answer:
        return "kitty"
    attributes = answer.rpartition("\x1b[?")[2].partition("c")[0].split(";")
    return "sixel" if "4" in attributes[1:] else "blocks"


def _asked(question: str) -> str:
    """Return what the terminal answers; empty if it answers nothing in time."""
    descriptor = sys.stdin.fileno()
    before = termios.tcgetattr(descriptor)
    answer = b""
    try:
        tty.setcbreak(descriptor)
        sys.stdout.write(question)
        sys.stdout.flush()
        end_s = time.monotonic() + ANSWER_S
        while (left_s := end_s - time.monotonic()) > 0:
            if not select.select([descriptor], [], [], left_s)[0]:
                break
            answer += os.read(descriptor, 256)
            if b"\x1b[?" in answer and answer.endswith(b"c"):
                break
    finally:
        termios.tcsetattr(descriptor, termios.TCSADRAIN, before)
    return answer.decode(errors="replace")


def drawn(bgr: Bgr, form: Form, columns: int, rows: int) -> str:
    """Return a picture as text that draws it at the cursor, within columns and rows.

    The picture is (height, width, 3); a character is twice as high as wide.
    """
    if form == "blocks":
        return blocks(_fitted(bgr, columns, 2 * rows))
    fitted = _fitted(bgr, columns * CELL_PX[0], rows * CELL_PX[1])
    return kitty(fitted) if form == "kitty" else sixel(fitted)


def _fitted(bgr: Bgr, width: int, height: int) -> Bgr:
    """Return a picture no larger than this, with its ratio of width to height."""
    scale = min(width / bgr.shape[1], height / bgr.shape[0], 1.0)
    size = max(1, round(bgr.shape[1] * scale)), max(1, round(bgr.shape[0] * scale))
    return np.asarray(cv2.resize(bgr, size, interpolation=cv2.INTER_AREA), np.uint8)


def blocks(bgr: Bgr) -> str:
    """Return a picture as half blocks: two pixels, one above the other, in each character."""
    padded = np.pad(bgr, ((0, bgr.shape[0] % 2), (0, 0), (0, 0)))
    lines = []
    for above, below in zip(padded[::2], padded[1::2], strict=True):
        cells = []
        for (b, g, r), (low_b, low_g, low_r) in zip(above.tolist(), below.tolist(), strict=True):
            cells.append(f"\x1b[38;2;{r};{g};{b};48;2;{low_r};{low_g};{low_b}m\u2580")
        lines.append("".join(cells) + "\x1b[0m")
    return "\n".join(lines)


def kitty(bgr: Bgr) -> str:
    """Return a picture in Kitty's protocol, as PNG in parts."""
    data = base64.b64encode(codecs.encode_png(bgr)).decode()
    parts = [data[at : at + KITTY_CHUNK] for at in range(0, len(data), KITTY_CHUNK)]
    found = []
    for number, part in enumerate(parts):
        more = int(number < len(parts) - 1)
        # q=2: no answers, which would be read as typed.
        control = f"a=T,f=100,q=2,m={more}" if number == 0 else f"m={more}"
        found.append(f"\x1b_G{control};{part}\x1b\\")
    return "".join(found)


def sixel(bgr: Bgr) -> str:
    """Return a picture as Sixel, in a palette of 216 colours."""
    levels = (bgr.astype(np.uint16) * (LEVELS - 1) + 127) // 255
    colours = (levels[..., 2] * LEVELS + levels[..., 1]) * LEVELS + levels[..., 0]
    height, width = colours.shape
    used = np.unique(colours)
    palette = "".join(f"#{colour};2;{';'.join(map(str, _percent(colour)))}" for colour in used)
    bands = [_band(colours[top : top + 6]) for top in range(0, height, 6)]
    return f'\x1bP0;1q"1;1;{width};{height}{palette}{"-".join(bands)}\x1b\\'


def _percent(colour: int) -> tuple[int, int, int]:
    """Return red, green and blue of a colour of the palette, percent."""
    red, rest = divmod(int(colour), LEVELS * LEVELS)
    return tuple(round(100 * level / (LEVELS - 1)) for level in (red, *divmod(rest, LEVELS)))  # type: ignore[return-value]


def _band(colours: NDArray[np.uint16]) -> str:
    """Return up to six rows: for each colour, a character of six bits for each column."""
    weights = 1 << np.arange(len(colours), dtype=np.uint8)[:, np.newaxis]
    rows = []
    for colour in np.unique(colours):
        bits = ((colours == colour) * weights).sum(axis=0)
        rows.append(f"#{colour}{''.join(_runs(bits.tolist()))}")
    return "$".join(rows)


def _runs(values: list[int]) -> Iterator[str]:
    """Yield the characters of six bits, with repetitions of more than three as a number."""
    start = 0
    for at in range(1, len(values) + 1):
        if at == len(values) or values[at] != values[start]:
            character, count = chr(63 + values[start]), at - start
            yield f"!{count}{character}" if count > 3 else character * count
            start = at
