"""The format of the launch file: its tables and keys, and the errors for wrong ones."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import Annotated, Any, NoReturn

from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field, ValidationError

from zenoh_vision.cli.processors import Affinity, JpegThreads, Nice, ProcessorSettings, Threads
from zenoh_vision.config.constraints import Form, allowed_and_default, unknown_key, wrong_value
from zenoh_vision.config.durations import SECONDS
from zenoh_vision.config.settings import NAME_FORM, CameraName, CameraNames, Text, read_toml
from zenoh_vision.errors import ConfigurationError
from zenoh_vision.keys import DEFAULT_CAMERA, DEFAULT_NAMESPACE, NAME
from zenoh_vision.transport.connection import DEFAULT_ENDPOINT
from zenoh_vision.transport.endpoint_option import Endpoint
from zenoh_vision.transport.endpoints import FORM
from zv.registry import SERVICES

NODE_SERVICES = tuple(name for name in SERVICES if name != "router")


def _words(value: object) -> object:
    """Split a text as a shell does; nothing in it is expanded."""
    if isinstance(value, list):
        return tuple(value)
    if not isinstance(value, str):
        return value
    try:
        return tuple(shlex.split(value))
    except ValueError as error:
        raise ValueError(f"cannot be split into words: {str(error).lower()}") from None


def _without_nul(value: str) -> str:
    if "\0" in value:
        raise ValueError("a NUL character cannot be passed to a program")
    return value


Word = Annotated[str, AfterValidator(_without_nul)]
Variable = Annotated[str, Field(pattern=r"^[A-Za-z_][A-Za-z0-9_]*$")]


class Table(BaseModel):
    """Base of the tables of a launch file."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True)


class RouterTable(Table):
    """``[router]``: the router that the nodes connect to."""

    listen: Annotated[
        Endpoint | None,
        Field(
            description="Zenoh endpoint that the embedded router listens on; "
            f"not set: {DEFAULT_ENDPOINT}"
        ),
        Form(FORM),
    ] = None
    connect: Annotated[
        Endpoint | None,
        Field(description="endpoint of a running router to use instead of starting one"),
        Form(FORM),
    ] = None
    zenoh_config: Annotated[
        str | None,
        Field(description="Zenoh's JSON5 file for the router, relative to the launch file"),
    ] = None


class NodeTable(Table):
    """``[[node]]``: one process."""

    service: Annotated[
        str,
        Field(
            description=f"one of {', '.join(NODE_SERVICES)}; with command, a name of your own, "
            "in a-z, 0-9 and _"
        ),
    ]
    command: Annotated[
        tuple[Word, ...] | None,
        BeforeValidator(_words),
        Field(
            description="program to start instead of a service of zv: a list of its arguments, or "
            "a text that is split as a shell does; nothing is expanded"
        ),
    ] = None
    camera: Annotated[
        CameraNames,
        Field(
            description="camera of the node, whose name is {service}_{camera}; not for a viewer. "
            "A command has none unless it is given. A tracker may have several, as front,left, or "
            "* for all, and is then named tracker"
        ),
    ] = DEFAULT_CAMERA
    config: Annotated[
        str | None, Field(description="TOML file with options, relative to the launch file")
    ] = None
    settings: Annotated[
        dict[str, Any], Field(description="options that override those in config")
    ] = {}
    env: Annotated[
        dict[Variable, Annotated[Text, AfterValidator(_without_nul)]],
        Field(description="environment variables of a command"),
    ] = {}
    cwd: Annotated[
        str | None,
        Field(
            description="working directory of a command, relative to the launch file; not set: "
            "the folder of the launch file"
        ),
    ] = None
    restart: Annotated[bool, Field(description="restart the process when it dies")] = True
    required: Annotated[
        bool,
        Field(
            description="end all nodes, and zv up with this node's exit status, when the process "
            "ends for any reason; it is never restarted then"
        ),
    ] = False
    threads: Threads = 1
    jpeg_threads: JpegThreads = 0
    nice: Nice = 0
    affinity: Affinity = None

    def processor_variables(self) -> dict[str, str]:
        """Return the environment variables that pass the table's limits of CPU use to a service."""
        limits = self.model_fields_set & ProcessorSettings.model_fields.keys()
        prefix = ProcessorSettings.env_prefix
        return {f"{prefix}{name.upper()}": str(getattr(self, name)) for name in sorted(limits)}


GRACE_S = 5.0
"""As in docker-compose.yml."""

Grace = Annotated[
    float,
    Field(
        ge=0,
        le=3600,
        description="how long nodes may take to end after SIGTERM before they are killed, such as "
        "10s; overridden by zv up --grace",
    ),
    SECONDS,
]


class LaunchTables(Table):
    """The whole file."""

    namespace: Annotated[
        str | None,
        Field(
            pattern=f"^{NAME.pattern}$",
            description=f"first chunk of every key expression; not set: {DEFAULT_NAMESPACE}",
        ),
        NAME_FORM,
    ] = None
    remap: Annotated[
        dict[CameraName, CameraName],
        Field(
            description='table [remap] of cameras, OLD = "NEW": nodes of camera OLD become those '
            "of NEW; overridden by zv up --remap OLD=NEW"
        ),
    ] = {}
    grace: Grace = GRACE_S
    router: Annotated[RouterTable, Field(description="table [router]")] = RouterTable()
    node: Annotated[list[NodeTable], Field(min_length=1, description="one or more [[node]]")]


def read_tables(path: Path) -> LaunchTables:
    """Read a launch file and check the form of its tables.

    Raises:
        SourceError: The file cannot be opened.
        ConfigurationError: The file is wrong; the text has the key, its value and what is allowed.
    """
    values = read_toml(path)
    try:
        return LaunchTables.model_validate(values)
    except ValidationError as error:
        _refuse(path, error)


def _refuse(path: Path, error: ValidationError) -> NoReturn:
    # Report an unknown key rather than a missing one: it may be the missing one, misspelled.
    first = min(error.errors(include_url=False), key=lambda each: each["type"] == "missing")
    loc = tuple(part for part in first["loc"] if part != "[key]")
    dotted = "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in loc)
    place = f"{path}: {dotted.lstrip('.')}"
    tables: dict[str, type[BaseModel]] = {"router": RouterTable, "node": NodeTable}
    model = tables.get(str(loc[0]), LaunchTables) if len(loc) > 1 else LaunchTables
    # The key of the table whose value is wrong, or contains the wrong value at any depth.
    name = str(loc[min({"node": 2, "router": 1}.get(str(loc[0]), 0), len(loc) - 1)])
    if first["type"] == "extra_forbidden":
        raise ConfigurationError(f"{place}: {unknown_key(name, name, model)}")
    missing = first["type"] == "missing"
    message = f"{place} is missing" if missing else wrong_value(place, first["input"], first)
    if name in model.model_fields:
        # A table or a list has no range to show.
        only_described = missing or name in (
            "remap",
            "node",
            "command",
            "env",
            "settings",
        )
        words = model.model_fields[name].description
        message += f"; allowed: {words if only_described else allowed_and_default(model, name)}"
    raise ConfigurationError(message)
