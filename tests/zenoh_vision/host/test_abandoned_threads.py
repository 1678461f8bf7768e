"""A process ends with its status although a thread that nobody waits for is in OpenCV."""

from __future__ import annotations

import sys

import pytest

from tests.support.processes import run_program

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
