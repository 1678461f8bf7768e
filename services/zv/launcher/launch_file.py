"""Reads the launch file and checks the options of every node in it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, NoReturn

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from zenoh_vision.config.constraints import allowed_and_default, unknown_key, wrong_value
from zenoh_vision.config.settings import CameraName, Settings, load_settings, read_toml
from zenoh_vision.error_text import shortened, suggestion
from zenoh_vision.errors import ConfigurationError
from zenoh_vision.keys import DEFAULT_CAMERA, DEFAULT_NAMESPACE
from zenoh_vision.transport.connection import DEFAULT_ENDPOINT
from zv.registry import SERVICES, model_of

NODE_SERVICES = tuple(name for name in SERVICES if name != "router")


class Table(BaseModel):
    """Base of the tables of a launch file."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True)


class RouterTable(Table):
    """``[router]``: the router that the nodes connect to."""

    listen: Annotated[
        str | None,
        Field(
            description="Zenoh endpoint that the embedded router listens on; "
            f"not set: {DEFAULT_ENDPOINT}"
        ),
    ] = None
    connect: Annotated[
        str | None, Field(description="endpoint of a running router to use instead of starting one")
    ] = None
    zenoh_config: Annotated[
        str | None,
        Field(description="Zenoh's JSON5 file for the router, relative to the launch file"),
    ] = None


class NodeTable(Table):
    """``[[node]]``: one process."""

    service: Annotated[str, Field(description=f"one of {', '.join(NODE_SERVICES)}")]
    camera: Annotated[
        CameraName,
        Field(description="camera of the node, whose name is {service}_{camera}; not for a viewer"),
    ] = DEFAULT_CAMERA
    config: Annotated[
        str | None, Field(description="TOML file with options, relative to the launch file")
    ] = None
    settings: Annotated[
        dict[str, Any], Field(description="options that override those in config")
    ] = {}
    restart: Annotated[bool, Field(description="restart the process when it dies")] = True


class LaunchTables(Table):
    """The whole file."""

    namespace: Annotated[
        str | None,
        Field(description=f"first chunk of every key expression; not set: {DEFAULT_NAMESPACE}"),
    ] = None
    router: Annotated[RouterTable, Field(description="table [router]")] = RouterTable()
    node: Annotated[list[NodeTable], Field(min_length=1, description="one or more [[node]]")]


@dataclass(frozen=True, slots=True)
class PlannedNode:
    """One node with its checked options.

    Attributes:
        name: ``{service}_{camera}``, or ``{service}`` of one that serves all cameras.
    """

    name: str
    service: str
    settings: Settings
    restart: bool


@dataclass(frozen=True, slots=True)
class Plan:
    """The content of a launch file.

    Attributes:
        place: The file, as errors name it.
        connection: ``namespace`` and ``connect``, if the file sets them.
        listen: Where its router listens; None if the file does not set it.
    """

    place: str
    connection: dict[str, str]
    listen: str | None
    router_config: str | None
    nodes: tuple[PlannedNode, ...]


def read_launch_file(path: Path) -> Plan:
    """Read a launch file and check the options of every node in it.

    The environment overrides the file: ``ZV_CAMERA_SOURCE`` is the source of every camera in it.

    Raises:
        ConfigurationError: The file is wrong; the text has the key, its value and what is allowed.
    """
    values = read_toml(path)
    try:
        tables = LaunchTables.model_validate(values)
    except ValidationError as error:
        _refuse(path, error)
    nodes: list[PlannedNode] = []
    for index, table in enumerate(tables.node):
        node = _planned(path, f"{path}: node[{index}]", table)
        if node.name in (other.name for other in nodes):
            raise ConfigurationError(
                f"{path}: node[{index}]: there is already a {node.name}; allowed: each service "
                "once per camera"
            )
        nodes.append(node)
    stated = {"namespace": tables.namespace, "connect": tables.router.connect}
    return Plan(
        place=str(path),
        connection={name: value for name, value in stated.items() if value is not None},
        listen=tables.router.listen,
        router_config=_beside(path, f"{path}: router.zenoh_config", tables.router.zenoh_config),
        nodes=tuple(nodes),
    )


def _planned(path: Path, place: str, table: NodeTable) -> PlannedNode:
    if table.service not in NODE_SERVICES:
        hint = suggestion(table.service, NODE_SERVICES, after=" ")
        raise ConfigurationError(
            f"{place}.service = {shortened(table.service)} is not allowed; {hint}"
            f"allowed: {', '.join(NODE_SERVICES)}"
        )
    if "camera" in table.settings:
        raise ConfigurationError(
            f"{place}.settings.camera = {shortened(table.settings['camera'])} is not allowed; "
            "allowed: camera = ... beside settings"
        )
    of_camera = SERVICES[table.service].of_camera
    if not of_camera and "camera" in table.model_fields_set:
        raise ConfigurationError(
            f"{place}.camera = {table.camera!r} is not allowed: a {table.service} serves all "
            "cameras; allowed: leave it out"
        )
    settings = load_settings(
        model_of(table.service),
        flags={"camera": table.camera} if of_camera else {},
        config=_beside(path, f"{place}.config", table.config),
        inline=table.settings,
        inline_place=f"{place}.settings",
    )
    name = f"{table.service}_{table.camera}" if of_camera else table.service
    return PlannedNode(name, table.service, settings, table.restart)


def _beside(path: Path, place: str, name: str | None) -> str | None:
    """Return the path of a file that the launch file names, relative to itself."""
    if name is None:
        return None
    found = path.parent / name
    if not found.is_file():
        raise ConfigurationError(f"{place} = {name!r} is not allowed: there is no file {found}")
    return str(found)


def _refuse(path: Path, error: ValidationError) -> NoReturn:
    first = error.errors(include_url=False)[0]
    loc = first["loc"]
    dotted = "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in loc)
    place = f"{path}: {dotted.lstrip('.')}"
    tables: dict[str, type[BaseModel]] = {"router": RouterTable, "node": NodeTable}
    model = tables.get(str(loc[0]), LaunchTables) if len(loc) > 1 else LaunchTables
    name = str(loc[-1])
    if first["type"] == "extra_forbidden":
        raise ConfigurationError(f"{place}: {unknown_key(name, name, model)}")
    missing = first["type"] == "missing"
    message = f"{place} is missing" if missing else wrong_value(place, first["input"], first)
    if name in model.model_fields:
        only_described = missing or model is LaunchTables  # a table has no range
        words = model.model_fields[name].description
        message += f"; allowed: {words if only_described else allowed_and_default(model, name)}"
    raise ConfigurationError(message)
