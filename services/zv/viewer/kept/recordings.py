"""Finds the recordings in a folder that hold a moment of a camera."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import Any, Final

from zenoh_vision import keys
from zv.bag.record import RecordingError
from zv.bag.recording import Recording

MOST_OPENED: Final = 50
"""Files that are opened for one moment: those that were closed first after it."""

LEAD_S: Final = 3.0
"""The command begins this long before the moment, which is when the event was kept."""


def recordings_of(folder: Path, camera: str, at_ns: int) -> list[dict[str, Any]]:
    """Return the recordings that hold a moment of a camera, the one that was closed first first.

    Those that are not closed, cannot be read, or are no recordings are left out. Folders in the
    folder are not searched. ``at_ns`` is when a sample arrived, ns since 1970, by the clock of this
    machine.

    Returns:
        For each the file's name, ``at_s`` since its begin, and the command that shows it from
        shortly before.
    """
    later: list[tuple[int, Path]] = []
    for path in folder.glob("*.mcap"):
        try:
            written_ns = path.stat().st_mtime_ns
        except OSError:  # deleted meanwhile
            continue
        if written_ns >= at_ns:
            later.append((written_ns, path))
    found = []
    for _, path in sorted(later)[:MOST_OPENED]:
        try:
            with Recording(path) as recording:
                is_within = recording.is_closed and recording.start_ns <= at_ns <= recording.end_ns
                if not is_within or camera not in map(keys.camera_of, recording.counts()):
                    continue
                at_s = (at_ns - recording.start_ns) / 1e9
        except RecordingError:
            continue
        command = ["zv", "view", str(path), "--start", f"{max(0.0, at_s - LEAD_S):.1f}s"]
        found.append({"file": path.name, "at_s": round(at_s, 3), "command": shlex.join(command)})
    return found
