"""Cameras and vision on the network over Zenoh: the public names for your own services.

docs/library.md describes the names, ``__init__.pyi`` lists them with their modules. Each is
imported when it is first used, so that programs that need only a few of them, such as
``zv --help``, start quickly.
"""

from __future__ import annotations

import importlib
import re
from pathlib import Path
from typing import Any

_STUB = Path(__file__).with_suffix(".pyi").read_text(encoding="utf-8")
_MODULES: dict[str, str] = {
    name: module for module, name in re.findall(r"^from (\S+) import (\w+) as \2$", _STUB, re.M)
}

__all__ = sorted(_MODULES)


def __getattr__(name: str) -> Any:
    """Import a public name when it is first used."""
    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = getattr(importlib.import_module(_MODULES[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    """Return the public names."""
    return __all__
