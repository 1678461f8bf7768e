"""A test that hangs for ever ends, and is shown."""

from __future__ import annotations

import sys
from pathlib import Path

from tests.support.processes import ROOT, run_program

# It hides the signal by which pytest-timeout ends a test, as Zenoh's code does while it blocks.
HANGING = """
import signal, threading

def test_hangs():
    signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGALRM})
    threading.Event().wait()
"""


def test_a_test_that_no_signal_reaches_ends_and_its_lines_are_shown(tmp_path: Path):
    (tmp_path / "test_it.py").write_text(HANGING)
    own = ("-c", ROOT / "pyproject.toml", "--rootdir", tmp_path, "-p", "no:cacheprovider")
    short = ("-o", "timeout=0.5", "-o", "faulthandler_timeout=1", "--max-worker-restart", "0")
    done = run_program([sys.executable, "-m", "pytest", *own, *short, "-n", "1", tmp_path])
    assert done.returncode == 1
    assert "crashed while running 'test_it.py::test_hangs'" in done.stdout
    assert f'{tmp_path}/test_it.py", line 6 in test_hangs' in done.stderr
