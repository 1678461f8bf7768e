"""The launch file: which nodes there are, and whether each one's options are right."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from common.errors import ConfigurationError
from common.keys import NAME
from common.settings import ServiceSettings, Settings, load_settings, read_toml, unknown
from services.catalogue import SERVICES, model_of

NAME_PATTERN = f"^{NAME.pattern}$"
ENDPOINT_PATTERN = r"^(tcp|tls|udp|quic|ws|unixsock-stream)/.+$"


class RouterTable(BaseModel):
    """``[router]``: where the nodes meet."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True)

    listen: Annotated[str, Field(pattern=ENDPOINT_PATTERN)] = "tcp/127.0.0.1:7447"
    connect: Annotated[str, Field(pattern=ENDPOINT_PATTERN)] | None = None
    zenoh_config: str | None = None

    @property
    def reach(self) -> str:
        """Where a node on this machine finds the router: an any-address is no destination."""
        endpoint = self.listen.split("#")[0].split("?")[0]
        return endpoint.replace("/0.0.0.0:", "/127.0.0.1:").replace("/[::]:", "/[::1]:")


class NodeTable(BaseModel):
    """``[[node]]``: one process."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True)

    service: Annotated[str, Field(pattern=NAME_PATTERN)]
    camera: Annotated[str, Field(pattern=NAME_PATTERN)] = "front"
    config: str | None = None
    settings: dict[str, Any] = {}
    restart: bool = True


class LaunchTables(BaseModel):
    """The whole file."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True)

    namespace: Annotated[str, Field(pattern=NAME_PATTERN)] = "vision"
    router: RouterTable = RouterTable()
    node: Annotated[list[NodeTable], Field(min_length=1)]


@dataclass(frozen=True, slots=True)
class PlannedNode:
    """One node whose options were found good.

    Attributes:
        name: ``{service}_{camera}``.
        restart: Whether it is started again when it dies.
    """

    name: str
    service: str
    settings: Settings
    restart: bool


@dataclass(frozen=True, slots=True)
class Plan:
    """What a launch file asks for."""

    namespace: str
    router: RouterTable
    nodes: tuple[PlannedNode, ...]


def read_launch_file(path: Path) -> Plan:
    """Read a launch file and check the options of every node in it.

    Raises:
        ConfigurationError: Naming the file, the key, its value and what is allowed.
    """
    tables = _tables(path, read_toml(path))
    nodes: list[PlannedNode] = []
    for index, table in enumerate(tables.node):
        place = f"{path}: node[{index}]"
        if table.service not in SERVICES or table.service == "router":
            services = ", ".join(name for name in SERVICES if name != "router")
            raise ConfigurationError(
                f"{place}: service = {table.service!r} is not allowed; allowed: {services}"
            )
        name = f"{table.service}_{table.camera}"
        if name in (node.name for node in nodes):
            raise ConfigurationError(f"{place}: there is a {name} already; names must differ")
        if "camera" in table.settings:
            raise ConfigurationError(f"{place}: camera stands beside settings, not in them")
        model = model_of(table.service)
        assert issubclass(model, ServiceSettings)
        settings = load_settings(
            model,
            flags={"camera": table.camera},
            config=path.parent / table.config if table.config else None,
            inline=table.settings,
            inline_place=f"{place}: settings",
        )
        nodes.append(PlannedNode(name, table.service, settings, table.restart))
    return Plan(tables.namespace, tables.router, tuple(nodes))


def with_router(plan: Plan, *, listen: str | None, connect: str | None) -> Plan:
    """Return the plan with the command line's router instead of the file's.

    Raises:
        ConfigurationError: An endpoint is malformed.
    """
    table = plan.router.model_dump()
    if connect:
        table["connect"] = connect
    if listen:
        table |= {"listen": listen, "connect": None}
    try:
        return replace(plan, router=RouterTable.model_validate(table))
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        raise ConfigurationError(
            f"command line: --{first['loc'][0]} = {first['input']!r} is not allowed; "
            "allowed: tcp/HOST:PORT"
        ) from None


def _tables(path: Path, values: dict[str, Any]) -> LaunchTables:
    try:
        return LaunchTables.model_validate(values)
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
    loc = first["loc"]
    place = "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in loc)
    place = f"{path}: {place.lstrip('.')}"
    if first["type"] == "extra_forbidden":
        tables: dict[str, type[BaseModel]] = {"router": RouterTable, "node": NodeTable}
        model = tables.get(str(loc[0]), LaunchTables) if len(loc) > 1 else LaunchTables
        raise ConfigurationError(f"{place}: {unknown(str(loc[-1]), str(loc[-1]), model)}")
    if first["type"] == "missing":
        raise ConfigurationError(f"{place}: is missing; a launch file names at least one [[node]]")
    raise ConfigurationError(f"{place} = {first['input']!r} is not allowed: {first['msg']}")


def flags_of(settings: Settings) -> list[str]:
    """Return the flags that give a process these settings; defaults are left out.

    Other layers, the environment among them, were merged before: flags go over all of them.
    """
    flags: list[str] = []
    for name, field in type(settings).model_fields.items():
        value = getattr(settings, name)
        if value == field.default and name != "camera":
            continue
        spelled = name.replace("_", "-")
        if isinstance(value, bool):
            flags.append(f"--{spelled}" if value else f"--no-{spelled}")
        else:
            flags += [f"--{spelled}", str(value)]
    return flags
