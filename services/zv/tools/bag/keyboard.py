"""Keys of the terminal that control a replay."""

from __future__ import annotations

import os
import select
import sys
import threading
from collections.abc import Callable
from typing import Any, Final, Self

HELP: Final = "space: pause, s: step, left and right: 5 s, up and down: speed, 0: begin, q: quit"

KEYS: Final = {
    b" ": "pause",
    b"s": "step",
    b"\x1b[C": "forward",
    b"\x1b[D": "back",
    b"\x1b[A": "faster",
    b"\x1b[B": "slower",
    b"0": "begin",
    b"q": "quit",
}
POLL_S: Final = 0.2


class Keyboard:
    """Calls a function with the word for each key, while in its ``with`` and on a terminal.

    It is called on a thread, with one of the words of ``KEYS``.
    """

    def __init__(self, pressed: Callable[[str], None]) -> None:
        self._pressed = pressed
        self._before: list[Any] | None = None
        self._ended = threading.Event()
        self._thread: threading.Thread | None = None

    @property
    def active(self) -> bool:
        """Whether there is a terminal whose keys are read."""
        return self._before is not None

    def __enter__(self) -> Self:
        """Let the terminal pass on each key at once; does nothing without a terminal."""
        try:
            import termios
            import tty

            number = sys.stdin.fileno()
            # A program in the background would be stopped by its terminal.
            if not os.isatty(number) or os.tcgetpgrp(number) != os.getpgrp():
                return self
            self._before = termios.tcgetattr(number)
            tty.setcbreak(number, termios.TCSANOW)
        except (ImportError, OSError, ValueError):  # no such terminal, or standard input is closed
            return self
        self._thread = threading.Thread(target=self._read, args=(number,), daemon=True)
        self._thread.start()
        return self

    def __exit__(self, *error: object) -> None:
        """Let the terminal be as it was."""
        if self._before is None:
            return
        import termios

        self._ended.set()
        termios.tcsetattr(sys.stdin.fileno(), termios.TCSANOW, self._before)

    def _read(self, number: int) -> None:
        held = b""
        while not self._ended.is_set():
            if not select.select([number], [], [], POLL_S)[0]:
                held = b""
                continue
            data = os.read(number, 64)
            if not data:
                return
            words, held = words_of(held + data)
            for word in words:
                self._pressed(word)


def words_of(data: bytes) -> tuple[list[str], bytes]:
    """Return the words of the keys in what a terminal sent, and the begin of an unfinished key."""
    words: list[str] = []
    while data:
        for code, word in KEYS.items():
            if data.startswith(code):
                words.append(word)
                data = data[len(code) :]
                break
        else:
            if data in (b"\x1b", b"\x1b["):
                return words, data
            data = data[1:]
    return words, b""
