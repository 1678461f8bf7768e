"""Finds the evaluation data, which is not part of the project."""

from __future__ import annotations

import os
from pathlib import Path

ROOT = Path(__file__).parents[2]


def data_folder() -> Path:
    """Return the folder of the data: ``$ZV_TEST_DATA``, else ``../shared/data``."""
    return Path(os.environ.get("ZV_TEST_DATA") or ROOT.parent / "shared" / "data")


def found(*names: str) -> list[Path] | None:
    """Return the paths of data files; if any is missing, print which ones and return None.

    The measurement goes on without what depends on them.
    """
    folder = data_folder()
    missing = [name for name in names if not (folder / name).exists()]
    if missing:
        print(f"# not measured: {', '.join(missing)} not in {folder}; set ZV_TEST_DATA", flush=True)
        return None
    return [folder / name for name in names]
