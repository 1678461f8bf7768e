"""Which version of this distribution runs."""

from __future__ import annotations

from functools import cache
from importlib import metadata


@cache
def installed_version() -> str:
    """Return the version of this distribution, ``unknown`` when run without installing it."""
    try:
        return metadata.version("zenoh-vision")
    except metadata.PackageNotFoundError:
        return "unknown"
