"""A regression test of results: each recording beside this file gives the results it has.

Make a recording with the results that are right, and look at them once:

    zv bag verify run.mcap --node tracker --update golden.mcap

Then `pytest test_golden.py` runs the tracker on its frames after each change of settings, code or
libraries. A difference fails with frame, field and both values; the picture shows it.
"""

import subprocess
import sys
from pathlib import Path

import pytest

FOLDER = Path(__file__).parent
NODE = "tracker"
TOLERANCE = "0.01"  # of positions, in pixels, and of all other floats


@pytest.mark.parametrize("recording", sorted(FOLDER.glob("*.mcap")), ids=lambda path: path.stem)
def test_the_results_are_as_recorded(recording: Path, tmp_path: Path) -> None:
    picture = tmp_path / f"{recording.stem}.png"
    command = ["bag", "verify", str(recording), "--node", NODE, "--tolerance", TOLERANCE]
    done = subprocess.run(
        [sys.executable, "-m", "zv", *command, "--picture", str(picture)],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
