"""``Plan``: what is recorded, into which files, and when."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Final

from zenoh_vision.errors import ConfigurationError
from zenoh_vision.messages import Level

MEMORY_BYTES: Final = 256 << 20

MAX_REASON: Final = 64
"""Characters of the reason of a trigger, which becomes part of a file's name."""

LEVELS: Final[dict[str, int]] = {
    "warn": Level.WARN,
    "error": Level.ERROR,
    "stale": Level.STALE,
}


@dataclass(frozen=True)
class Plan:
    """What is recorded, into which files, and when.

    Attributes:
        output: The file; with ``split`` or ``last`` its name is the begin of those of several.
        keys: Key expressions; empty: all of the cameras' data that is not made for display only.
        exclude: Key expressions of what is left out.
        split_bytes: A file that is larger is closed, and another begun.
        split_s: As for a file that is older.
        total_bytes: When the files of this name are larger together, the oldest are deleted.
        last_s: Keep this many seconds in memory, and write them when something triggers it.
        after_s: How long is recorded after a trigger.
        on_event: Kinds of track events that trigger, or ``KIND:ZONE``; ``*`` for any.
        on_level: Levels of health that trigger.
        memory_bytes: Limit of what waits for the disk, and of what ``last_s`` keeps.
        mode: Permissions of the files.
        profile: ``ros2`` writes messages of ROS, and leaves out what it has none for.

    Raises:
        ConfigurationError: Something triggers it, but it keeps no last seconds.
    """

    output: Path
    keys: tuple[str, ...] = ()
    exclude: tuple[str, ...] = ()
    split_bytes: int | None = None
    split_s: float | None = None
    total_bytes: int | None = None
    last_s: float | None = None
    after_s: float = 10.0
    on_event: tuple[str, ...] = ()
    on_level: tuple[str, ...] = ()
    memory_bytes: int = MEMORY_BYTES
    mode: int = 0o600
    profile: str = ""

    def __post_init__(self) -> None:
        if self.last_s is None and (self.on_event or self.on_level):
            raise ConfigurationError(
                "--on-event and --on-level write the last seconds: give --last"
            )

    @property
    def is_series(self) -> bool:
        """Whether there are several files, with a time in their names."""
        return bool(self.split_bytes or self.split_s or self.last_s or self.total_bytes)
