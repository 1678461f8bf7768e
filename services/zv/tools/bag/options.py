"""The options of the tools that record, show and repair recordings."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field, model_validator

from zenoh_vision.config.constraints import Form
from zenoh_vision.config.settings import Argument, Letter
from zv.bag.recorder.plan import MAX_REASON, Plan
from zv.tools.shared.options import SECONDS, ToolOptions

File = Annotated[str, Argument("FILE"), Field(min_length=1, description="a recording")]
Target = Annotated[
    str, Letter("o"), Field(min_length=1, description="file to write; it must not exist")
]
Start = Annotated[
    float, Field(ge=0, description="from this time after the begin of the file"), SECONDS
]
End = Annotated[
    float | None, Field(gt=0, description="until this time after the begin of the file"), SECONDS
]


def check_part(options: Any) -> Any:
    """Return options; raise ValueError unless their ``end`` is after their ``start``."""
    if options.end is not None and options.end <= options.start:
        raise ValueError(f"--end {options.end:g} s is not after --start {options.start:g} s")
    return options


class RecordOptions(ToolOptions):
    """Options of ``zv bag record``."""

    keys: Annotated[
        tuple[str, ...],
        Argument("KEY"),
        Field(description="key expressions of what is recorded; @ keys need to be named"),
    ] = ()
    output: Target
    exclude: Annotated[
        tuple[str, ...], Field(description="key expression of what is left out; repeatable")
    ] = ()
    for_: Annotated[
        float | None, Field(gt=0, description="how long to record; default: until Ctrl-C"), SECONDS
    ] = None
    split_mb: Annotated[
        float | None,
        Field(gt=0, le=1e9, description="begin another file when one has this many MB"),
    ] = None
    split: Annotated[
        float | None, Field(ge=1, description="begin another file after this time"), SECONDS
    ] = None
    total_mb: Annotated[
        float | None,
        Field(gt=0, le=1e9, description="delete the oldest files when all have more MB than this"),
    ] = None
    last: Annotated[
        float | None,
        Field(ge=0.1, le=3600, description="keep this time in memory until it is triggered"),
        SECONDS,
    ] = None
    after: Annotated[
        float, Field(ge=0, le=3600, description="how long to record after a trigger"), SECONDS
    ] = 10.0
    on_event: Annotated[
        tuple[str, ...],
        Field(description="track event that triggers: KIND, KIND:ZONE, or *; repeatable"),
    ] = ()
    on_level: Annotated[
        tuple[Literal["warn", "error", "stale"], ...],
        Field(description="health of any node that triggers; repeatable"),
    ] = ()
    memory_mb: Annotated[
        float, Field(ge=1, le=1e6, description="limit of what waits for the disk, and of --last")
    ] = 256.0
    profile: Annotated[
        Literal["", "ros2"],
        Field(
            description="ros2: messages of ROS 2, for ros2 bag; what ROS has no message for is "
            "left out, and zv cannot play the file"
        ),
    ] = ""
    readable: Annotated[
        bool, Field(description="let all users read the files; else only their owner can")
    ] = False

    def plan(self) -> Plan:
        """Return what, where and when is recorded."""
        return Plan(
            output=Path(self.output),
            keys=self.keys,
            exclude=self.exclude,
            split_bytes=None if self.split_mb is None else int(self.split_mb * 1e6),
            split_s=self.split,
            total_bytes=None if self.total_mb is None else int(self.total_mb * 1e6),
            last_s=self.last,
            after_s=self.after,
            on_event=self.on_event,
            on_level=self.on_level,
            memory_bytes=int(self.memory_mb * 1e6),
            mode=0o644 if self.readable else 0o600,
            profile=self.profile,
        )


class InfoOptions(ToolOptions):
    """Options of ``zv bag info``."""

    file: File
    minutes: Annotated[bool, Field(description="show what was missed in each minute")] = False


class RepairOptions(ToolOptions):
    """Options of ``zv bag repair``."""

    file: File
    output: Annotated[
        str | None,
        Letter("o"),
        Field(min_length=1, description="copy what is readable into this file, which is new"),
    ] = None


class TriggerOptions(ToolOptions):
    """Options of ``zv bag trigger``."""

    recorder: Annotated[
        str,
        Argument("RECORDER"),
        Field(pattern=r"^([a-z0-9_]+|\*)$", description="recorder, bag_record, or * for all"),
        Form("a name, or *"),
    ] = "*"
    reason: Annotated[
        str,
        Field(min_length=1, max_length=MAX_REASON, description="becomes part of the files' names"),
    ] = "command"


class CutOptions(ToolOptions):
    """Options of ``zv bag cut``."""

    file: File
    output: Target
    start: Start = 0.0
    end: End = None

    _part = model_validator(mode="after")(check_part)


class MergeOptions(ToolOptions):
    """Options of ``zv bag merge``."""

    files: Annotated[
        tuple[str, ...], Argument("FILE"), Field(min_length=1, description="recordings")
    ]
    output: Target


class FilterOptions(ToolOptions):
    """Options of ``zv bag filter``."""

    file: File
    keys: Annotated[
        tuple[str, ...], Argument("KEY"), Field(description="key expressions of what is kept")
    ] = ()
    output: Target
    exclude: Annotated[
        tuple[str, ...], Field(description="key expression of what is left out; repeatable")
    ] = ()


class ConvertOptions(ToolOptions):
    """Options of ``zv bag convert``."""

    file: File
    output: Target
    profile: Annotated[
        Literal["ros2"],
        Field(description="ros2: messages of ROS 2, for ros2 bag and Foxglove"),
    ] = "ros2"


class ExportOptions(ToolOptions):
    """Options of ``zv bag export``."""

    file: File
    output: Annotated[
        str,
        Letter("o"),
        Field(
            min_length=1,
            description="what to write: FOLDER/ for frames and frames.csv, FILE.mp4, FILE.csv for "
            "--field, FILE.txt for tracks in the format of the MOT challenge",
        ),
    ]
    key: Annotated[
        str | None,
        Field(description="which key; default: the only one that fits"),
    ] = None
    field: Annotated[
        tuple[str, ...],
        Field(description="field of a message for FILE.csv, such as header.seq; default: all"),
    ] = ()
    draw: Annotated[
        bool, Field(description="draw the tracks, or the centroid, of each frame into FILE.mp4")
    ] = False
    start: Start = 0.0
    end: End = None

    _part = model_validator(mode="after")(check_part)


class ImportOptions(ToolOptions):
    """Options of ``zv bag import``."""

    source: Annotated[
        str,
        Argument("SOURCE"),
        Field(min_length=1, description="a video, a folder of images, or a recording of ROS"),
    ]
    output: Target
    camera: Annotated[
        str,
        Field(pattern="^[a-z0-9_]+$", max_length=64, description="name of the camera"),
        Form("letters a-z, digits and _"),
    ] = "front"
    rate: Annotated[
        float | None,
        Field(gt=0, le=1000, description="frames per second of a folder; default: 10"),
    ] = None
    quality: Annotated[
        int, Field(ge=1, le=100, description="JPEG quality of what is no JPEG or PNG already")
    ] = 90
    lossless: Annotated[
        bool, Field(description="write PNG instead of JPEG for what is neither")
    ] = False
