"""A terminal to run ``zv`` in, with what it shows as text; and what rich draws, as text."""

from __future__ import annotations

import fcntl
import os
import pty
import re
import struct
import subprocess
import sys
import termios
import threading
from collections.abc import Callable, Sequence

from rich.console import Console, RenderableType

from tests.support.processes import ROOT, STOP_S, environment
from tests.support.waiting import DEADLINE_S, wait_until

ESCAPES = re.compile(r"\x1b\[[0-9;?]*[A-Za-z]")


class Terminal:
    """``zv`` in a terminal of its own.

    Args:
        arguments: Behind ``zv``.
        columns: Its width.
        variables: Added to the environment.
        program: Module that is ``zv``.
    """

    def __init__(
        self,
        arguments: Sequence[str],
        *,
        columns: int = 80,
        variables: dict[str, str] | None = None,
        program: str = "zv",
    ) -> None:
        self._ours, theirs = pty.openpty()
        fcntl.ioctl(theirs, termios.TIOCSWINSZ, struct.pack("HHHH", 24, columns, 0, 0))
        kept = environment()
        for name in ("NO_COLOR", "FORCE_COLOR", "COLUMNS", "LINES"):
            kept.pop(name, None)
        self._process = subprocess.Popen(
            [sys.executable, "-m", program, *arguments],
            stdin=theirs,
            stdout=theirs,
            stderr=theirs,
            cwd=ROOT,
            env={**kept, "TERM": "xterm-256color", **(variables or {})},
            start_new_session=True,
            preexec_fn=lambda: fcntl.ioctl(0, termios.TIOCSCTTY, 0),
        )
        os.close(theirs)
        self._shown = b""
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    @property
    def pid(self) -> int:
        return self._process.pid

    @property
    def raw(self) -> str:
        return self._shown.decode(errors="replace")

    @property
    def text(self) -> str:
        """All that was written so far, without colours and moves of the cursor."""
        return ESCAPES.sub("", self.raw)

    def until(self, condition: Callable[[str], object], deadline_s: float = DEADLINE_S) -> str:
        """Return the text as soon as the condition holds for it."""
        wait_until(lambda: condition(self.text), deadline_s, lambda: self.text)
        return self.text

    def press(self, keys: bytes) -> None:
        """Press keys, as the bytes that a terminal sends for them."""
        os.write(self._ours, keys)

    def press_ctrl_c(self) -> None:
        """Send what the key sends; the terminal makes a signal of it."""
        os.write(self._ours, b"\x03")

    def end(self, within_s: float = STOP_S) -> int:
        """Wait for the end and return the exit status."""
        status = self._process.wait(within_s)
        self._reader.join(within_s)
        os.close(self._ours)
        return status

    def _read(self) -> None:
        try:
            while chunk := os.read(self._ours, 65536):
                self._shown += chunk
        except OSError:
            return  # the other side is closed


def rendered(shown: RenderableType) -> str:
    """Return the text on a wide terminal without colours."""
    console = Console(width=200, color_system=None)
    with console.capture() as capture:
        console.print(shown)
    return capture.get()
