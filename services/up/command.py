"""What a child is started with: its command line and its environment."""

from __future__ import annotations

import os
from pathlib import Path
from urllib.parse import urlsplit

from common import heartbeat
from common.settings import Secret
from services.catalogue import command_of as command_name
from services.launch_file import PlannedNode

RESOLVED = ("ZV_CONNECT", "ZV_NAMESPACE", "ZV_ZENOH_CONFIG", "ZV_TIMEOUT", heartbeat.VARIABLE)
"""Variables that ``zv up`` has read for all its children, who get them as flags if at all.

The heartbeat's file is its own: it speaks for all of them.
"""

ROOT = Path(__file__).parent.parent.parent


def command_of(node: PlannedNode) -> tuple[list[str], dict[str, str]]:
    """Return the command line that gives a process these settings, and its environment.

    Defaults are left out. What is secret goes by environment: everyone on a machine can read
    the command lines of all processes.
    """
    flags = [command_name(node.service)]
    secret: dict[str, str] = {}
    model = type(node.settings)
    for name, field in model.model_fields.items():
        value = getattr(node.settings, name)
        if value == field.default and name != "camera":
            continue
        flag = f"--{name.replace('_', '-')}"
        if isinstance(value, bool):
            flags.append(flag if value else f"--no-{flag[2:]}")
        elif Secret in map(type, field.metadata) or _is_secret(str(value)):
            secret[f"{model.env_prefix}{name.upper()}"] = str(value)
        else:
            flags += [flag, str(value)]
    return flags, secret


def _is_secret(text: str) -> bool:
    try:
        return "://" in text and urlsplit(text).username is not None
    except ValueError:
        return False


def inherited() -> dict[str, str]:
    """Return our environment without what we resolved, with our packages to be found."""
    found = {name: value for name, value in os.environ.items() if name not in RESOLVED}
    if ROOT.name not in ("site-packages", "dist-packages"):  # a checkout, perhaps not installed
        found["PYTHONPATH"] = os.pathsep.join(
            part for part in (str(ROOT), os.environ.get("PYTHONPATH")) if part
        )
    return found
