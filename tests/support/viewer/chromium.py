"""Finds the Chromium that tests, benchmarks and the picture of the viewer use."""

from __future__ import annotations

import os
import shutil

WINDOWLESS = "chromium-headless-shell"
"""The Debian package that .ci/run installs. It has no window at all, and takes half the processor
time of the other."""
NO_CHROMIUM = f"no chromium; on Debian: apt-get install {WINDOWLESS}, or set ZV_TEST_CHROMIUM"


def chromium() -> str | None:
    """Return its path: $ZV_TEST_CHROMIUM, else one of the two of Debian; None if there is none."""
    given = os.environ.get("ZV_TEST_CHROMIUM")
    return given or shutil.which(WINDOWLESS) or shutil.which("chromium")
