"""Lists the video devices of this machine, and explains why one cannot be opened (Linux)."""

from __future__ import annotations

import os
from pathlib import Path

GIVE_ACCESS = "sudo usermod -aG video $USER"

STABLE = ("dev/v4l/by-id", "dev/v4l/by-path")
"""Where udev keeps names that do not depend on the order in which devices are found: by the serial
number of a device, and by the port into which it is plugged."""


def device_nodes(root: Path = Path("/")) -> list[Path]:
    """Return the existing ``/dev/video*`` in the order of their numbers."""
    nodes = [node for node in (root / "dev").glob("video*") if node.name[5:].isdecimal()]
    return sorted(nodes, key=lambda node: int(node.name[5:]))


def stable_paths(node: Path, root: Path = Path("/")) -> list[str]:
    """Return the paths of a device that stay the same, the one by serial number first."""
    found = []
    for folder in STABLE:
        links = sorted((root / folder).glob("*"))
        found += [link for link in links if os.path.realpath(link) == os.path.realpath(node)]
    return [f"/{link.relative_to(root)}" for link in found]


def describe(node: Path, root: Path = Path("/")) -> str:
    """Return a device's stable path if it has one, its node, and its driver's name for it."""
    try:
        name = (root / "sys/class/video4linux" / node.name / "name").read_text().strip()
    except OSError:
        name = ""
    path, stable = f"/{node.relative_to(root)}", stable_paths(node, root)
    words = ", ".join(filter(None, [path if stable else "", name]))
    return f"{(stable or [path])[0]} ({words})" if words else path


def why_not(device: str, root: Path = Path("/")) -> str:
    """Return why the device at a path cannot be opened, and a remedy; empty if that is unknown."""
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
    return ""
