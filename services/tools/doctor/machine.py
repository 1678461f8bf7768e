"""Checks of this machine: video devices and the right to use them."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path

from common.video_devices import GIVE_ACCESS, describe, device_nodes
from services.tools.doctor.finding import Finding


def device_findings(root: Path = Path("/")) -> Iterator[Finding]:
    """Judge the video devices.

    Args:
        root: Where ``dev`` and ``sys`` are.
    """
    nodes = device_nodes(root)
    if not nodes:
        yield Finding(
            "OK",
            "devices",
            "this machine has no video device (/dev/video*); synthetic, files, folders and URLs "
            "need none",
        )
    for node in nodes:
        device = describe(node, root)
        if os.access(node, os.R_OK | os.W_OK):
            yield Finding("OK", "devices", f"{device} can be read and written")
        else:
            yield Finding(
                "WARN",
                "devices",
                f"{device}: permission is missing to read and write it",
                f"join its group: {GIVE_ACCESS}, then log in again",
            )
