"""The processes that benchmarks start."""

from __future__ import annotations

import pytest

from benchmarks.system import System


def test_a_process_that_has_ended_ends_the_measurement_with_its_name():
    system = System()
    system.start("tracker_c1", "-c", "raise SystemExit(3)")
    system.processes["tracker_c1"].wait(20)
    with pytest.raises(SystemExit, match="tracker_c1 has ended with status 3"):
        system.cpu_s()
