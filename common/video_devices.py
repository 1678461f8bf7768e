"""Which video devices this machine has, and why one cannot be opened (Linux)."""

from __future__ import annotations

import os
import re
from pathlib import Path

GIVE_ACCESS = "sudo usermod -aG video $USER"


def device_nodes(root: Path = Path("/")) -> list[Path]:
    """Return the ``/dev/video*`` that exist, by number."""
    nodes = (root / "dev").glob("video*")
    numbered = [
        (int(node.name[5:]), node) for node in nodes if re.fullmatch(r"video\d+", node.name)
    ]
    return [node for _, node in sorted(numbered)]


def describe(node: Path, root: Path = Path("/")) -> str:
    """Return a device's path with the name that its driver gives it, when that can be read."""
    try:
        name = (root / "sys/class/video4linux" / node.name / "name").read_text().strip()
    except OSError:
        name = ""
    path = "/" + str(node.relative_to(root))
    return f"{path} ({name})" if name else path


def why_not(device: str, root: Path = Path("/")) -> str:
    """Return what is known about why a device cannot be opened, and what can be done.

    Args:
        device: Its path, ``/dev/video0``.
        root: Where ``dev`` and ``sys`` are.
    """
    nodes = device_nodes(root)
    node = root / device.lstrip("/")
    if not node.exists():
        if not nodes:
            return (
                "this machine has no video device (/dev/video*); --source synthetic needs none, "
                "and a video file, a folder of images or a URL will do as well"
            )
        there = ", ".join(describe(other, root) for other in nodes)
        return f"there is no such device; there are: {there}"
    if not os.access(node, os.R_OK | os.W_OK):
        return (
            "permission is missing to read and write it; devices belong to the group video: "
            f"{GIVE_ACCESS}, then log in again"
        )
    others = [describe(other, root) for other in nodes if other != node]
    hint = f"; there are also: {', '.join(others)}" if others else ""
    return f"it is busy with another program, or no device that captures pictures{hint}"
