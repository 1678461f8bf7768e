"""``zv`` as one types it, to its end."""

from __future__ import annotations

import subprocess
import sys

from tests.processes import ROOT, START_S, environment


def zv(endpoint: str, *arguments: str) -> subprocess.CompletedProcess[str]:
    """Run a command at a router and return its output and status."""
    return subprocess.run(
        [sys.executable, "-m", "services", *arguments, "--connect", endpoint],
        capture_output=True,
        text=True,
        cwd=ROOT,
        env=environment(),
        timeout=START_S,
        check=False,
    )
