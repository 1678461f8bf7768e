"""Lists the video devices of this machine, and explains why one cannot be opened (Linux)."""

from __future__ import annotations

import os
from pathlib import Path

GIVE_ACCESS = "sudo usermod -aG video $USER"


def device_nodes(root: Path = Path("/")) -> list[Path]:
    """Return the existing ``/dev/video*`` in the order of their numbers."""
    nodes = [node for node in (root / "dev").glob("video*") if node.name[5:].isdecimal()]
    return sorted(nodes, key=lambda node: int(node.name[5:]))


def describe(node: Path, root: Path = Path("/")) -> str:
    """Return a device's path, with its driver's name for it if that can be read."""
    try:
        name = (root / "sys/class/video4linux" / node.name / "name").read_text().strip()
    except OSError:
        name = ""
    path = "/" + str(node.relative_to(root))
    return f"{path} ({name})" if name else path


def why_not(device: str, root: Path = Path("/")) -> str:
    """Return the probable reason why the device at a path cannot be opened, and a remedy."""
    nodes = device_nodes(root)
    node = root / device.lstrip("/")
    if not node.exists():
        if nodes:
            there = ", ".join(describe(other, root) for other in nodes)
            return f"there is no such device; there are: {there}"
        return (
            "this machine has no video device (/dev/video*); --source synthetic needs none, "
            "and a video file, a folder of images or a URL will do as well"
        )
    if not os.access(node, os.R_OK | os.W_OK):
        return (
            "permission is missing to read and write it; devices belong to the group video: "
            f"{GIVE_ACCESS}, then log in again"
        )
    others = [describe(other, root) for other in nodes if other != node]
    hint = f"; there are also: {', '.join(others)}" if others else ""
    return f"it is busy with another program, or no device that captures pictures{hint}"
