"""The launch file: which nodes there are, and whether each one's options are right."""

from __future__ import annotations

import difflib
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, NoReturn

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from common.connection import DEFAULT_ENDPOINT
from common.errors import ConfigurationError
from common.keys import DEFAULT_CAMERA, DEFAULT_NAMESPACE
from common.settings import (
    CameraName,
    Settings,
    allowed,
    load_settings,
    read_toml,
    unknown,
)
from services.catalogue import SERVICES, model_of

NODE_SERVICES = tuple(name for name in SERVICES if name != "router")


class Table(BaseModel):
    """Base of the file's tables."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True)


class RouterTable(Table):
    """``[router]``: where the nodes meet."""

    listen: Annotated[
        str | None,
        Field(
            description="Zenoh endpoint that the embedded router listens on; "
            f"not set: {DEFAULT_ENDPOINT}"
        ),
    ] = None
    connect: Annotated[
        str | None, Field(description="use the router there instead of starting one")
    ] = None
    zenoh_config: Annotated[
        str | None,
        Field(description="the router's own JSON5 configuration file, beside the launch file"),
    ] = None


class NodeTable(Table):
    """``[[node]]``: one process."""

    service: Annotated[str, Field(description=f"one of {', '.join(NODE_SERVICES)}")]
    camera: Annotated[
        CameraName,
        Field(description="camera it belongs to; its name is {service}_{camera}; not for a viewer"),
    ] = DEFAULT_CAMERA
    config: Annotated[
        str | None, Field(description="TOML file of its options, beside the launch file")
    ] = None
    settings: Annotated[
        dict[str, Any], Field(description="options that go over those in config")
    ] = {}
    restart: Annotated[bool, Field(description="start it again when it dies")] = True


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
    """One node whose options were found good.

    Attributes:
        name: ``{service}_{camera}``, or ``{service}`` of one that serves all cameras.
        restart: Whether it is started again when it dies.
    """

    name: str
    service: str
    settings: Settings
    restart: bool


@dataclass(frozen=True, slots=True)
class Plan:
    """What a launch file asks for.

    Attributes:
        place: The file, as errors name it.
        connection: What it says of the connection: ``namespace``, ``connect``, or neither.
        listen: Where its router listens; None if it does not say.
        router_config: The router's own configuration file.
    """

    place: str
    connection: dict[str, str]
    listen: str | None
    router_config: str | None
    nodes: tuple[PlannedNode, ...]


def read_launch_file(path: Path) -> Plan:
    """Read a launch file and check the options of every node in it.

    The environment goes over the file: ``ZV_CAMERA_SOURCE`` is the source of every camera in it.

    Raises:
        ConfigurationError: Naming the file, the key, its value and what is allowed.
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
                f"{path}: node[{index}]: there is a {node.name} already; allowed: each service "
                "once for a camera"
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
        near = difflib.get_close_matches(table.service, NODE_SERVICES, 1)
        hint = f"did you mean {near[0]!r}? " if near else ""
        raise ConfigurationError(
            f"{place}.service = {table.service!r} is not allowed; {hint}"
            f"allowed: {', '.join(NODE_SERVICES)}"
        )
    if "camera" in table.settings:
        raise ConfigurationError(
            f"{place}.settings.camera = {table.settings['camera']!r} is not allowed; "
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
    """Return a file that the launch file names; its place is relative to the launch file's."""
    if name is None:
        return None
    found = path.parent / name
    if not found.is_file():
        raise ConfigurationError(f"{place} = {name!r} is not allowed: there is no file {found}")
    return str(found)


def _refuse(path: Path, error: ValidationError) -> NoReturn:
    """Say what is wrong with a table."""
    first = error.errors(include_url=False)[0]
    loc = first["loc"]
    dotted = "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in loc)
    place = f"{path}: {dotted.lstrip('.')}"
    tables: dict[str, type[BaseModel]] = {"router": RouterTable, "node": NodeTable}
    model = tables.get(str(loc[0]), LaunchTables) if len(loc) > 1 else LaunchTables
    name = str(loc[-1])
    if first["type"] == "extra_forbidden":
        raise ConfigurationError(f"{place}: {unknown(name, name, model)}")
    if first["type"] == "missing":
        words = model.model_fields[name].description
        raise ConfigurationError(f"{place} is missing; allowed: {words}")
    message = f"{place} = {first['input']!r} is not allowed ({first['msg']})"
    if name in model.model_fields and model is not LaunchTables:
        message += f"; allowed: {allowed(model.model_fields[name], name, model)}"
    elif name in model.model_fields:
        message += f"; allowed: {model.model_fields[name].description}"
    raise ConfigurationError(message)
