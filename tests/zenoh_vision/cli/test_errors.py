"""How a process ends: with its status, whatever its threads do, and at once."""

from __future__ import annotations

import logging
import re
import sys
from pathlib import Path

import pytest

from tests.support.processes import run_program
from zenoh_vision.cli.errors import LogLine

PROGRAM = """
import threading, time
import cv2, numpy as np
from zenoh_vision.cli.errors import exit_with_status
from zenoh_vision.host import abandoned_threads

def work():
    pixels = np.zeros((1080, 1920, 3), np.uint8)
    while True:
        cv2.GaussianBlur(pixels, (5, 5), 1)

for _ in range(4):
    thread = threading.Thread(target=work, daemon=True)
    thread.start()
    abandoned_threads.abandon(thread)
time.sleep(0.1)
exit_with_status(lambda: print("done") or STATUS)
"""


@pytest.mark.parametrize("status", [0, 3])
def test_a_thread_in_opencv_does_not_abort_the_end_of_its_process(status: int):
    done = run_program([sys.executable, "-c", PROGRAM.replace("STATUS", str(status))])
    assert (done.returncode, done.stdout, done.stderr) == (status, "done\n", "")


COLLECTS = """
import atexit, gc
from zenoh_vision.cli.errors import exit_with_status

atexit.register(lambda: print(len(gc.get_objects()) < 1000))
exit_with_status(lambda: 0)
"""


def test_at_its_end_a_program_does_not_look_through_all_objects_for_garbage():
    """With numpy, OpenCV and pydantic loaded that takes a tenth of a second."""
    assert run_program([sys.executable, "-c", COLLECTS]).stdout == "True\n"


@pytest.mark.parametrize(
    "look",
    [
        f"Path({'n' * 300!r}).exists()",
        'exec(\'raise PermissionError(errno.EACCES, "Permission denied", "/root/a.mcap")\')',
    ],
)
def test_a_file_that_must_not_even_be_looked_for_is_no_bug_but_cannot_be_opened(look: str):
    program = f"""
import errno
from pathlib import Path
from zenoh_vision.cli.errors import exit_with_status
exit_with_status(lambda: list([{look}]))
"""
    done = run_program([sys.executable, "-c", program])
    assert done.returncode == 3
    assert re.fullmatch(r"zv: (n+: File name too long|/root/a\.mcap: .*denied)\n", done.stderr)


def test_streams_that_are_closed_are_opened_on_the_null_device():
    program = """
import os, sys
from zenoh_vision.cli.errors import exit_with_status
def run():
    assert sys.stdin.read() == ""
    print("a result")
    print("an error", file=sys.stderr)
    return 0 if os.open("/etc/passwd", os.O_RDONLY) > 2 else 1
exit_with_status(run)
"""
    words = ["sh", "-c", 'exec "$@" <&- >&- 2>&-', "sh", sys.executable, "-c", program]
    assert run_program(words).returncode == 0


def test_a_current_folder_that_was_deleted_is_no_bug(tmp_path: Path):
    program = (
        "import os; from pathlib import Path; "
        "from zenoh_vision.cli.errors import exit_with_status; "
        f"os.chdir({str(tmp_path)!r}); os.rmdir({str(tmp_path)!r}); "
        "exit_with_status(lambda: print(Path('x').absolute()))"
    )
    done = run_program([sys.executable, "-c", program])
    said = "zv: the current folder was deleted; change to another one\n"
    assert (done.returncode, done.stdout, done.stderr) == (3, "", said)


@pytest.mark.parametrize(
    ("redirections", "said"),
    [(">/dev/full", "zv: cannot write: No space left on device\n"), (">/dev/full 2>&1", "")],
)
def test_a_full_disk_under_the_output_is_no_bug(redirections: str, said: str):
    program = """
from zenoh_vision.cli.errors import exit_with_status
exit_with_status(lambda: print("a result", flush=True))
"""
    words = [
        "sh",
        "-c",
        f'unset PYTHONUNBUFFERED; exec "$@" {redirections}',
        "sh",
        sys.executable,
        "-c",
        program,
    ]
    done = run_program(words)
    assert (done.returncode, done.stderr) == (3, said)


def record(message: str, *values: str) -> logging.LogRecord:
    """Return an entry about an exception."""
    found = (ValueError, ValueError(message), None)
    return logging.LogRecord("tracker", logging.ERROR, "f", 1, "no %s", values, found)


def test_an_exception_in_the_log_is_one_line():
    form = (
        r"\d\d:\d\d:\d\d ERROR   tracker: no answer: ValueError: two lines "
        r"\(--debug shows the traceback\)"
    )
    entry = record("two\nlines", "answer")
    assert re.fullmatch(form, LogLine(debug=False).format(entry))
    assert entry.exc_info is not None, "kept for other handlers"


def test_with_debug_it_has_its_traceback():
    try:
        raise ValueError("two\nlines")
    except ValueError as error:
        entry = record("", "answer")
        entry.exc_info = (ValueError, error, error.__traceback__)
    lines = LogLine(debug=True).format(entry).splitlines()
    assert lines[0].endswith("ERROR   tracker: no answer")
    assert lines[1] == "Traceback (most recent call last):"


@pytest.mark.parametrize("debug", [False, True])
def test_foreign_text_in_an_entry_is_printable(debug: bool):
    text = LogLine(debug=debug).format(record("\x1b[2J\u202e", "\x1b]0;t\x07\nb"))
    assert all(line.isprintable() for line in text.split("\n"))
    assert "no \\x1b]0;t\\x07\\nb" in text
