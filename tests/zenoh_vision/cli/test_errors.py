"""How a program ends."""

from __future__ import annotations

import sys

from tests.support.processes import run_program

PROGRAM = """
import atexit, gc
from zenoh_vision.cli.errors import exit_with_status

atexit.register(lambda: print(len(gc.get_objects()) < 1000))
exit_with_status(lambda: 0)
"""


def test_at_its_end_a_program_does_not_look_through_all_objects_for_garbage():
    """With numpy, OpenCV and pydantic loaded that takes a tenth of a second."""
    assert run_program([sys.executable, "-c", PROGRAM]).stdout == "True\n"
