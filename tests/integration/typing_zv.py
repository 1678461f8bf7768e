"""``zv`` as one types it, to its end."""

from __future__ import annotations

import subprocess

from tests.typist import type_zv


def zv(endpoint: str, *arguments: str) -> subprocess.CompletedProcess[str]:
    """Run a command at a router and return its output and status."""
    return type_zv([*arguments, "--connect", endpoint])
