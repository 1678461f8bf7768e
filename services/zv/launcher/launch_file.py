"""Reads the launch file and checks the options of every node in it."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from pydantic import TypeAdapter, ValidationError

from zenoh_vision.config.settings import (
    CONNECTION,
    NAME_FORM,
    CameraName,
    Settings,
    cameras_of,
    load_settings,
    read_config,
)
from zenoh_vision.error_text import shortened, suggestion
from zenoh_vision.errors import ConfigurationError
from zenoh_vision.keys import NAME
from zv.launcher.command_line import found_program, program_flags, search_path
from zv.launcher.launch_paths import beside, check_paths
from zv.launcher.launch_tables import GRACE_S, NODE_SERVICES, LaunchTables, NodeTable, read_tables
from zv.registry import SERVICES, model_of

ONLY_WITH_COMMAND = ("env", "cwd")
OPTION_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_-]*")
CAMERA = TypeAdapter(CameraName)
OPTION_VALUES = "a text, a number, true, false, or a list of them"


@dataclass(frozen=True, slots=True)
class PlannedNode:
    """One node that is a service of ``zv``, with its checked options.

    Attributes:
        name: ``{service}_{camera}``, or ``{service}`` if it serves several or all cameras.
        required: Whether its end ends all nodes; it is not restarted then.
        variables: Environment variables that the launch file sets.
    """

    name: str
    service: str
    settings: Settings
    restart: bool
    required: bool = False
    variables: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class PlannedProgram:
    """One node that is any other program.

    Attributes:
        name: ``{service}_{camera}``, or ``{service}`` without a camera.
        words: The program's path and its arguments.
        variables: Environment variables that the launch file sets.
        folder: Its working directory.
    """

    name: str
    words: tuple[str, ...]
    variables: Mapping[str, str] = field(repr=False)
    folder: Path
    restart: bool
    required: bool = False


Planned = PlannedNode | PlannedProgram


@dataclass(frozen=True, slots=True)
class Plan:
    """The content of a launch file.

    Attributes:
        place: The file, as errors name it.
        connection: ``namespace`` and ``connect``, if the file sets them.
        listen: Where its router listens; None if the file does not set it.
        grace_s: How long nodes may take to end before they are killed.
    """

    place: str
    connection: dict[str, str]
    listen: str | None
    router_config: str | None
    nodes: tuple[Planned, ...]
    grace_s: float = GRACE_S


def read_launch_file(path: Path, remap: Mapping[str, str] | None = None) -> Plan:
    """Read a launch file and check the options of every node in it.

    A node's ``settings`` are as its flags: they override the environment, which overrides its
    ``config``. ``ZV_CAMERA_SOURCE`` is thus the source of every camera that has none there.

    ``remap`` has names to use instead of cameras, beside those in the file.

    Raises:
        SourceError: The file cannot be opened.
        ConfigurationError: The file is wrong; the text has the key, its value and what is allowed.
    """
    tables = read_tables(path)
    nodes: list[Planned] = []
    for index, table in enumerate(_remapped(path, tables, remap or {})):
        place = f"{path}: node[{index}]"
        node = (
            _planned(path, place, table) if table.command is None else _program(path, place, table)
        )
        for other in nodes:
            _check_two(place, node, other)
        nodes.append(node)
    stated = {"namespace": tables.namespace, "connect": tables.router.connect}
    return Plan(
        place=str(path),
        connection={name: value for name, value in stated.items() if value is not None},
        listen=tables.router.listen,
        router_config=beside(path, f"{path}: router.zenoh_config", tables.router.zenoh_config),
        nodes=tuple(nodes),
        grace_s=tables.grace,
    )


def _check_two(place: str, node: Planned, other: Planned) -> None:
    """Raise ConfigurationError if two nodes would publish the same keys, or have the same name."""
    if (
        isinstance(node, PlannedNode)
        and isinstance(other, PlannedNode)
        and node.service == other.service
        and SERVICES[node.service].of_camera
        and not hasattr(node.settings, "node_name")  # then the names of the nodes differ
    ):
        ours, theirs = (cameras_of(getattr(each.settings, "camera")) for each in (node, other))  # noqa: B009 - of these services
        if not ours or not theirs or set(ours) & set(theirs):
            both = ", ".join(sorted(set(ours) & set(theirs))) or "all cameras"
            raise ConfigurationError(
                f"{place}: there is already a {node.service} for {both}; allowed: each service "
                "once per camera"
            )
    if node.name == other.name:
        raise ConfigurationError(
            f"{place}: there is already a node called {node.name}; allowed: another name, or one "
            f"{node.name} for all its cameras"
        )


def remapped_cameras(texts: Sequence[str]) -> dict[str, str]:
    """Return the new name of each camera by its old one, from ``--remap OLD=NEW`` flags.

    Raises:
        ConfigurationError: One does not have this form, or a camera is named twice.
    """
    found: dict[str, str] = {}
    for text in texts:
        old, _, new = text.partition("=")
        try:
            CAMERA.validate_python(old)
            CAMERA.validate_python(new)
        except ValidationError:
            raise ConfigurationError(
                f"--remap = {shortened(text)} is not allowed; allowed: OLD=NEW, two names of "
                f"cameras: {NAME_FORM.words}, at most 64 characters"
            ) from None
        if old in found:
            raise ConfigurationError(f"--remap = {shortened(text)}: {old} was given before")
        found[old] = new
    return found


def _remapped(path: Path, tables: LaunchTables, remap: Mapping[str, str]) -> list[NodeTable]:
    """Return the tables of the nodes with the names of their cameras replaced."""
    cameras = {camera for table in tables.node for camera in _cameras_of(table)}
    both = [(f"{path}: remap.", tables.remap), (f"{path}: --remap ", remap)]
    for old, place in [(old, place) for place, names in both for old in names]:
        if old not in cameras:
            hint = suggestion(old, cameras, after=" ")
            there = ", ".join(sorted(cameras)) or "none, since no node has a camera"
            raise ConfigurationError(
                f"{place}{old} is not allowed: no node has this camera; {hint}allowed: {there}"
            )
    names = {**tables.remap, **remap}
    return [
        table.model_copy(update={"camera": ",".join(names.get(each, each) for each in own)})
        if (own := _cameras_of(table))
        else table
        for table in tables.node
    ]


def _cameras_of(table: NodeTable) -> tuple[str, ...]:
    """Return the names of the cameras in a node's table."""
    if table.command is not None:
        return cameras_of(table.camera) if "camera" in table.model_fields_set else ()
    service = SERVICES.get(table.service)
    return cameras_of(table.camera) if service is not None and service.of_camera else ()


def _planned(path: Path, place: str, table: NodeTable) -> PlannedNode:
    if table.service not in NODE_SERVICES:
        hint = suggestion(table.service, NODE_SERVICES, after=" ")
        raise ConfigurationError(
            f"{place}.service = {shortened(table.service)} is not allowed; {hint}"
            f"allowed: {', '.join(NODE_SERVICES)}, or a name of your own with command = ..."
        )
    for key in ONLY_WITH_COMMAND:
        if key in table.model_fields_set:
            raise ConfigurationError(
                f"{place}.{key} is not allowed for a service of zv; allowed: with command = ..."
            )
    _check_camera_beside_settings(place, table)
    service = SERVICES[table.service]
    of_camera = service.of_camera
    if not of_camera and "camera" in table.model_fields_set:
        raise ConfigurationError(
            f"{place}.camera = {table.camera!r} is not allowed: a {table.service} serves all "
            "cameras; allowed: leave it out"
        )
    if not service.of_several:
        _check_one_camera(place, table)
    config = beside(path, f"{place}.config", table.config)
    if config is not None and read_config(config)[1]:
        raise ConfigurationError(
            f"{config}: [{CONNECTION}] is not allowed for a node of zv up, which connects all its "
            "nodes; allowed: namespace and router.connect in the launch file, and --secure DIR"
        )
    settings = load_settings(
        model_of(table.service),
        flags={"camera": table.camera} if of_camera else {},
        config=config,
        inline=table.settings,
        inline_place=f"{place}.settings",
        inline_folder=path.parent,
        inline_wins=True,
    )
    check_paths(place, settings)
    cameras = _cameras_of(table)
    name = f"{table.service}_{cameras[0]}" if len(cameras) == 1 else table.service
    try:
        name = getattr(settings, "node_name", name)
    except ConfigurationError as error:  # of options that do not fit together
        raise ConfigurationError(f"{place}.settings: {error}") from None
    variables = table.processor_variables()
    restart = table.restart and not table.required
    return PlannedNode(name, table.service, settings, restart, table.required, variables)


def _program(path: Path, place: str, table: NodeTable) -> PlannedProgram:
    camera = table.camera if "camera" in table.model_fields_set else None
    if table.service == "router" or not NAME.fullmatch(table.service):
        raise ConfigurationError(
            f"{place}.service = {shortened(table.service)} is not allowed; allowed: a name of "
            f"your own of the form {NAME.pattern}, other than router"
        )
    _check_camera_beside_settings(place, table)
    _check_one_camera(place, table)
    name = table.service if camera is None else f"{table.service}_{camera}"
    folder = path.parent.absolute() / (table.cwd or "")
    if not folder.is_dir():
        raise ConfigurationError(
            f"{place}.cwd = {shortened(table.cwd)} is not allowed: there is no folder {folder}"
        )
    assert table.command is not None
    try:
        if not table.command:
            raise ConfigurationError("it is empty")
        program = found_program(table.command[0], table.env.get("PATH", search_path()), folder)
    except ConfigurationError as error:
        raise ConfigurationError(
            f"{place}.command = {shortened(list(table.command))} is not allowed: {name}: {error}; "
            f"allowed: a program on PATH, or its path relative to {folder}, and its arguments"
        ) from None
    config = beside(path, f"{place}.config", table.config)
    options = {} if camera is None else {"camera": camera}
    options |= {} if config is None else {"config": str(Path(config).absolute())}
    options |= {key: _option(place, key, value) for key, value in table.settings.items()}
    return PlannedProgram(
        name,
        (program, *table.command[1:], *program_flags(options)),
        {**table.processor_variables(), **table.env},
        folder,
        table.restart and not table.required,
        table.required,
    )


def _option(place: str, key: str, value: Any) -> Any:
    """Return an option of a program, checked."""
    if not OPTION_NAME.fullmatch(key):
        raise ConfigurationError(
            f"{place}.settings: {shortened(key)} is not allowed; allowed: names of the form "
            f"{OPTION_NAME.pattern}, which become flags"
        )
    values = value if isinstance(value, list) else [value]
    if not all(isinstance(each, str | int | float) and "\0" not in str(each) for each in values):
        raise ConfigurationError(
            f"{place}.settings.{key} = {shortened(value)} is not allowed for a command; "
            f"allowed: {OPTION_VALUES}"
        )
    return value


def _check_camera_beside_settings(place: str, table: NodeTable) -> None:
    if "camera" in table.settings:
        raise ConfigurationError(
            f"{place}.settings.camera = {shortened(table.settings['camera'])} is not allowed; "
            "allowed: camera = ... beside settings"
        )


def _check_one_camera(place: str, table: NodeTable) -> None:
    try:
        CAMERA.validate_python(table.camera)
    except ValidationError:
        raise ConfigurationError(
            f"{place}.camera = {shortened(table.camera)} is not allowed: {table.service} serves "
            f"one camera; allowed: {NAME_FORM.words}, at most 64 characters"
        ) from None
