"""A service that receives a signal while it starts ends with status 0, at every step of that."""

import signal
import time
from pathlib import Path

import pytest

from tests.support.processes import Program, catches
from tests.support.routing import free_endpoint
from tests.support.waiting import wait_until

STEP_S = 0.07


@pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="needs /proc")
@pytest.mark.parametrize("step", range(8))
def test_it_ends_with_0_at_once_and_says_nothing(tmp_path, step):
    with Program(
        ["-m", "zv", "camera", "--connect", free_endpoint()], tmp_path, "camera"
    ) as program:
        wait_until(lambda: catches(program.process.pid, signal.SIGTERM))
        time.sleep(step * STEP_S)  # another place in its start each time
        program.process.send_signal(signal.SIGTERM)
        assert program.process.wait(3) == 0
    assert "Traceback" not in program.complaints
