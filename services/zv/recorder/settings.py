"""The recorder's options."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, ClassVar, Literal

from pydantic import Field

from zenoh_vision.config.constraints import Form
from zenoh_vision.config.durations import SECONDS
from zenoh_vision.config.settings import LocalPath, Settings
from zv.bag.recorder.plan import Plan

KEYS_FORM = Form("key expressions, separated by commas")
KeyList = Annotated[str, Field(max_length=10_000)]


class RecorderSettings(Settings):
    """Options of ``zv recorder``."""

    env_prefix: ClassVar[str] = "ZV_RECORDER_"

    output: Annotated[
        str | None,
        Field(
            min_length=1,
            description="begin of the files' names, to which the time is added; their folder is "
            "made if it does not exist; not set: recordings/run.mcap in the working directory",
        ),
        LocalPath(is_made=True),
    ] = None
    keys: Annotated[
        KeyList,
        KEYS_FORM,
        Field(
            description="what is recorded, key expressions separated by commas; empty: all of the "
            "cameras' data that is not made for display only"
        ),
    ] = ""
    exclude: Annotated[
        KeyList,
        KEYS_FORM,
        Field(description="what is left out, key expressions separated by commas"),
    ] = ""
    split_mb: Annotated[
        float, Field(gt=0, le=1e9, description="begin another file when one has this many MB")
    ] = 1000.0
    split: Annotated[
        float, Field(ge=1, le=31e6, description="begin another file after this time"), SECONDS
    ] = 600.0
    total_mb: Annotated[
        float,
        Field(gt=0, le=1e9, description="delete the oldest files when all have more MB than this"),
    ] = 10_000.0
    last: Annotated[
        float | None,
        Field(
            ge=0.1,
            le=3600,
            description="write nothing until something triggers it: then as much before it, and "
            "the time --after it; not set: record all the time",
        ),
        SECONDS,
    ] = None
    after: Annotated[
        float, Field(ge=0, le=3600, description="how long to record after a trigger"), SECONDS
    ] = 10.0
    on_event: Annotated[
        str,
        Field(
            max_length=1000,
            description="track events that trigger: KIND or KIND:ZONE, separated by commas; * for "
            "any",
        ),
        Form("KIND or KIND:ZONE, separated by commas"),
    ] = ""
    on_level: Annotated[
        Literal["", "warn", "error", "stale"],
        Field(description="health of any node that triggers"),
    ] = ""
    memory_mb: Annotated[
        float,
        Field(
            ge=1,
            le=1e6,
            description="limit of what waits in memory for the disk, and of what --last keeps",
        ),
    ] = 256.0

    def plan(self) -> Plan:
        """Return what, where and when it records."""
        return Plan(
            output=Path(self.output or "recordings/run.mcap"),
            keys=_listed(self.keys),
            exclude=_listed(self.exclude),
            split_bytes=int(self.split_mb * 1e6),
            split_s=self.split,
            total_bytes=int(self.total_mb * 1e6),
            last_s=self.last,
            after_s=self.after,
            on_event=_listed(self.on_event),
            on_level=_listed(self.on_level),
            memory_bytes=int(self.memory_mb * 1e6),
        )


def _listed(text: str) -> tuple[str, ...]:
    return tuple(filter(None, (each.strip() for each in text.split(","))))
