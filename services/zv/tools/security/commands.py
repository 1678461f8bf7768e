"""The commands of ``zv security`` that change a system: init, add, renew, revoke."""

from __future__ import annotations

import json
import os
import time
from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Final

import zenoh

from zenoh_vision.error_text import joined
from zenoh_vision.errors import ConfigurationError, SourceError
from zenoh_vision.security.credentials import renewal, shown_time
from zenoh_vision.transport.connection import Connection
from zenoh_vision.transport.endpoints import MAX_PORT
from zv.tools.security.authority import LONGEST_NAME, new_authority
from zv.tools.security.folder import (
    AUTHORITY,
    AUTHORITY_KEY,
    COMPOSE,
    PRIVATE,
    PUBLIC,
    Folder,
    System,
)
from zv.tools.security.issuing import (
    HERE,
    Issuing,
    role_of_node,
    role_of_player,
    roles_of_all_cameras,
    roles_of_cameras,
    roles_of_people,
)
from zv.tools.security.options import (
    AddOptions,
    InitOptions,
    RenewOptions,
    RevokeOptions,
)
from zv.tools.security.roles import LAUNCHER, ROUTER, Role
from zv.tools.shared.output import Output

COMPOSE_APART: Final = 10_000
MOST_CHARACTERS: Final = LONGEST_NAME - len(".999")
"""Of a holder's name: its certificate's may end in a number, after a revocation."""


def init(options: InitOptions, connection: Connection, output: Output) -> None:
    """Make an authority, and certificates for the router, every node and the tools' users.

    Raises:
        ConfigurationError: The folder was used before, or a name is too long or given twice.
        SourceError: A file cannot be written.
    """
    folder = Folder(options.folder)
    hosts = tuple(dict.fromkeys((*options.host, *HERE)))
    named = [
        (ROUTER, Role(ROUTER)),
        *roles_of_cameras(dict.fromkeys(options.camera)),
        *roles_of_all_cameras(),
        (LAUNCHER, Role(LAUNCHER)),
        *roles_of_people(options.operator, options.guest),
    ]
    _check_names(name for name, _ in named)
    with folder.made():
        authority = new_authority(connection.namespace)
        folder.put(folder.path / AUTHORITY_KEY, authority.key.decode(), PRIVATE)
        folder.put(folder.path / AUTHORITY, authority.certificate.decode(), PUBLIC)
        endpoint = f"tls/{_in_brackets(hosts[0])}:{options.port}"
        system = System(connection.namespace, endpoint, options.port, options.days)
        issuing = Issuing(folder, authority)
        for name, role in named:
            own = hosts if role.kind == ROUTER else ()
            system = issuing.holder(system, name, role, hosts=own)
        issuing.routers(system)
        folder.put(folder.path / COMPOSE, _compose_variables(folder.path, options.port), PUBLIC)
        folder.write(system)
    names = [name for name, _ in named]
    output.result(
        {"folder": str(folder.path), "endpoint": endpoint, "holders": names},
        f"wrote {folder.path}: {', '.join(names)}",
        f"the router is found at {endpoint}; certificates end {shown_time(_first_end(system))}",
        f"keep {folder.path / AUTHORITY_KEY} where only you can read it: who has it can let "
        "anybody in",
        "next:",
        f"  zv up --secure {folder.path}",
        f"  zv topic list --credentials {folder.file_of(named[-1][0])}",
    )


def add(options: AddOptions, _connection: Connection, output: Output) -> None:
    """Give certificates to further nodes, users and routers.

    Raises:
        ConfigurationError: Nobody or somebody who has a certificate is named, or what a node may
            do is not.
        SourceError: A file cannot be read or written.
    """
    folder = Folder(options.dir)
    with folder.locked():
        system, issuing = folder.system(), Issuing(folder, folder.authority())
        named = [*roles_of_people(options.operator, options.guest)]
        named += role_of_player(options.player)
        if options.node is None:
            named += roles_of_cameras(options.camera)
        else:
            named.append((options.node, _role_in(system, options)))
        if options.router is not None:
            named.append((options.router, Role(ROUTER)))
            if not options.host:
                raise ConfigurationError(f"--router {options.router} needs --host, its name")
        if not named:
            raise ConfigurationError(
                "nobody is named; allowed: --camera, --operator, --guest, --player, --node or "
                "--router"
            )
        _check_names(name for name, _ in named)
        there = system.valid()
        known = [name for name, _ in named if name in there]
        named = [(name, role) for name, role in named if name not in there]
        if not named:
            have = "has a certificate" if len(known) == 1 else "have certificates"
            raise ConfigurationError(
                f"{', '.join(known)} {have} already; {renewal(folder.path, known[0])} "
                "gives another one, zv security revoke withdraws it"
            )
        connect = (options.connect_to,) if options.connect_to else ()
        for name, role in named:
            is_router = role.kind == ROUTER
            system = issuing.holder(
                system,
                name,
                role,
                hosts=tuple(dict.fromkeys((*options.host, *HERE))) if is_router else (),
                connect=connect if is_router else (),
            )
        issuing.routers(system)
        folder.write(system)
    files = [
        str((folder.router_file_of if role.kind == ROUTER else folder.file_of)(name))
        for name, role in named
    ]
    output.result({"added": files}, *(f"wrote {file}" for file in files), _reload(folder, system))
    _tell_if_shortened(output, issuing, system, [name for name, _ in named])


def renew(options: RenewOptions, _connection: Connection, output: Output) -> None:
    """Give holders another certificate and key of the same name; the former stay valid.

    Raises:
        ConfigurationError: Nobody has this name, or no name is given.
        SourceError: A file cannot be read or written.
    """
    folder = Folder(options.dir)
    with folder.locked():
        system, issuing = folder.system(), Issuing(folder, folder.authority())
        names = [*system.valid()] if options.all else [*options.name]
        if not names:
            raise ConfigurationError("nobody is named; allowed: NAME, or --all")
        for name in names:
            holder = system.holder(name)
            hosts = holder.hosts
            if options.host:
                if holder.role.kind != ROUTER:
                    raise ConfigurationError(
                        f"--host is not allowed for {name}, which is no router"
                    )
                hosts = tuple(dict.fromkeys((*hosts, *options.host)))
            system = issuing.holder(
                system, name, holder.role, hosts=hosts, connect=holder.connect, days=options.days
            )
        issuing.routers(system)
        folder.write(system)
    for name in names:
        ends = shown_time(system.holders[name].ends_s)
        output.result(
            {"name": name, "ends_s": system.holders[name].ends_s}, f"{name}: valid until {ends}"
        )
    _tell_if_shortened(output, issuing, system, names)
    output.note(
        "copy the files to where they are used; a node takes its own within 5 s, "
        "a container when it is restarted"
    )


def revoke(options: RevokeOptions, _connection: Connection, output: Output) -> None:
    """Withdraw the rights of all certificates that a holder has.

    Raises:
        ConfigurationError: Nobody has this name, or it is revoked already.
        SourceError: A file cannot be read or written.
    """
    folder = Folder(options.dir)
    with folder.locked():
        system, issuing = folder.system(), Issuing(folder, folder.authority())
        for name in dict.fromkeys(options.name):
            holder = replace(system.holder(name), revoked_s=time.time())
            system = system.with_holder(name, holder)
        if not system.routers():
            raise ConfigurationError(
                "the only router cannot be revoked; zv security init begins anew"
            )
        issuing.routers(system)
        folder.write(system)
        in_browsers = [name for name in options.name if folder.browser_file_of(name).exists()]
        try:
            for name in options.name:
                folder.remove(name)
        finally:  # they are revoked, also if a file cannot be deleted
            _tell_revoked(output, folder, system, options.name, in_browsers)


def _tell_revoked(
    output: Output, folder: Folder, system: System, names: Sequence[str], in_browsers: Sequence[str]
) -> None:
    said = f"revoked {', '.join(dict.fromkeys(names))}"
    output.result({"revoked": list(names)}, said, _reload(folder, system))
    if in_browsers:
        output.note(
            f"a viewer with --tls-clients still admits the browsers of {', '.join(in_browsers)}: "
            "take the name out of its --tls-operators and --tls-guests"
        )


def _tell_if_shortened(
    output: Output, issuing: Issuing, system: System, names: Iterable[str]
) -> None:
    """Say which certificates end with their authority, before the days that were asked for."""
    authority_s = issuing.authority.ends_s
    found = [name for name in names if system.holders[name].ends_s >= authority_s]
    if found:
        output.note(
            f"{joined(found)} valid until the authority's end, {shown_time(authority_s)}; before "
            "it, make another folder with zv security init and copy all files again"
        )


def _reload(folder: Folder, system: System) -> str:
    """Return how the routers take new rules."""
    said = "zv router and the compose file take the new rules within 5 s; restart any other router"
    files = [str(folder.router_file_of(name)) for name in system.routers() if name != ROUTER]
    return f"{said}, and copy {', '.join(files)} to where it runs" if files else said


def _role_in(system: System, options: AddOptions) -> Role:
    """Return the role of a node: as given, or as it was before it was revoked."""
    assert options.node is not None
    publishes, subscribes = options.publishes, options.subscribes
    former = system.holders.get(options.node)
    given = publishes or subscribes or options.description or options.camera
    if former is not None and former.role.kind != ROUTER and not given:
        return former.role
    if options.description is not None:
        about = _description(Path(options.description))
        publishes += about["publishes"]
        subscribes += about["subscribes"]
    return role_of_node(options.node, options.camera, publishes, subscribes)


def _description(file: Path) -> dict[str, tuple[str, ...]]:
    """Return the keys of data in a description of a node."""
    found: dict[str, tuple[str, ...]] = {}
    try:
        about = json.loads(file.read_text())
        for name in ("publishes", "subscribes"):
            keys = [str(key) for key in about[name] if not str(key).startswith("@")]
            found[name] = tuple(str(zenoh.KeyExpr(key)) for key in keys)
    except OSError as error:
        raise SourceError(f"{file}: {error.strerror or error}") from None
    except (ValueError, KeyError, TypeError, RecursionError, zenoh.ZError):
        raise ConfigurationError(
            f"{file}: no description of a node; allowed: the output of zv node info NODE --json"
        ) from None
    return found


def _check_names(names: Iterable[str]) -> None:
    seen: set[str] = set()
    for name in names:
        if name in seen:
            raise ConfigurationError(f"{name} is named twice; allowed: each name once")
        if len(name) > MOST_CHARACTERS:
            raise ConfigurationError(
                f"{name} is too long for a certificate: {len(name)} characters; allowed: "
                f"{MOST_CHARACTERS}"
            )
        seen.add(name)


def _compose_variables(folder: Path, port: int) -> str:
    return (
        "# For docker compose --env-file: the containers run as the owner of these files.\n"
        f"ZV_SECURITY={folder.resolve()}\n"
        f"ZV_SECURITY_OWNER={os.getuid()}:{os.getgid()}\n"
        f"ZV_SECURE_PORT={port}\n"
        "# The port that docker-compose.yml opens for this machine gives way to that one.\n"
        f"ZV_PORT={port + COMPOSE_APART if port + COMPOSE_APART < MAX_PORT else port - 1}\n"
    )


def _in_brackets(host: str) -> str:
    return f"[{host}]" if ":" in host else host


def _first_end(system: System) -> float:
    return min(each.ends_s for each in system.holders.values())
