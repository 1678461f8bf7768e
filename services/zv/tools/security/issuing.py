"""Issues certificates to the holders of a system, and writes everyone's file."""

from __future__ import annotations

import base64
from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Any, Final

from zenoh_vision.errors import ConfigurationError
from zenoh_vision.security.credentials import CA, CERTIFICATE, KEY, METADATA
from zv.registry import SERVICES
from zv.tools.security.authority import Issued, base64_of, issue
from zv.tools.security.folder import Folder, Holder, System
from zv.tools.security.roles import (
    GUEST,
    LAUNCHER,
    OPERATOR,
    OWN_NODE,
    PLAYER,
    ROUTER,
    Role,
    rights_of,
)
from zv.tools.security.router_file import MUTUAL, SEND_BUFFER, router_file

HERE: Final = ("localhost", "127.0.0.1", "::1", ROUTER)
"""Names of the router for programs on its machine, and for the containers beside it."""

NO_NODES: Final = (ROUTER, OPERATOR, GUEST, LAUNCHER)
"""Roles that announce no node."""

Named = Iterable[tuple[str, Role]]


def roles_of_cameras(cameras: Iterable[str]) -> Named:
    """Yield the nodes of each camera: of every service that belongs to one."""
    for camera in cameras:
        for service, entry in SERVICES.items():
            if entry.of_camera:
                yield f"{service}_{camera}", Role(service, (camera,))


def roles_of_all_cameras() -> Named:
    """Yield the nodes that serve the whole system, such as the viewer."""
    for service, entry in SERVICES.items():
        receives_only = entry.of_several and not entry.publishes
        if service != ROUTER and (receives_only or not entry.of_camera):
            yield service, Role(service)


def roles_of_people(operators: Iterable[str], guests: Iterable[str]) -> Named:
    """Yield those who use the tools."""
    for kind, names in ((OPERATOR, operators), (GUEST, guests)):
        for name in names:
            yield name, Role(kind)


def role_of_player(cameras: tuple[str, ...]) -> Named:
    """Yield who plays recordings of cameras, if there are some."""
    if cameras:
        yield PLAYER, Role(PLAYER, tuple(dict.fromkeys(cameras)))


def role_of_node(
    name: str, cameras: tuple[str, ...], publishes: tuple[str, ...], subscribes: tuple[str, ...]
) -> Role:
    """Return the role of one node: a service of several cameras, or one of the user's own.

    Raises:
        ConfigurationError: It is neither.
    """
    service = SERVICES.get(name)
    if service is not None and service.of_several and not publishes:
        if not cameras:
            raise ConfigurationError(f"--node {name} needs the --camera that it serves, each")
        return Role(name, cameras)
    if not publishes and not subscribes:
        raise ConfigurationError(
            f"--node {name} needs what it may do: --publishes KEY, --subscribes KEY, or "
            "--description FILE"
        )
    return Role(OWN_NODE, publishes=publishes, subscribes=subscribes)


@dataclass(frozen=True, slots=True)
class Issuing:
    """Gives certificates to holders, in one folder."""

    folder: Folder
    authority: Issued

    def holder(
        self,
        system: System,
        name: str,
        role: Role,
        *,
        hosts: tuple[str, ...] = (),
        connect: tuple[str, ...] = (),
        days: int | None = None,
    ) -> System:
        """Issue a certificate, write the holder's file, and return the system with it.

        That of a router is written with those of all, by ``routers``.

        Raises:
            SourceError: The file cannot be written.
        """
        former = system.holders.get(name)
        number = 1
        if former is not None:
            number = former.number + (former.revoked_s is not None)
        holder = Holder(role, 0.0, number, hosts, connect)
        issued = issue(self.authority, holder.common_name(name), hosts, days or system.days)
        holder = replace(holder, ends_s=issued.ends_s)
        if role.kind == ROUTER:
            self._write_router(system.with_holder(name, holder), name, issued)
        else:
            about = f"Credentials of {name}"
            file = self.folder.file_of(name)
            self.folder.write_private(file, about, self._credentials(system, name, role, issued))
        return system.with_holder(name, holder)

    def routers(self, system: System) -> None:
        """Write the configuration of each router again, with the certificate that it has.

        Raises:
            VisionError: A file cannot be read or written.
        """
        for name in system.routers():
            with self.folder.router(name) as content:
                tls = content["transport"]["link"]["tls"]
                parts = (tls[f"listen_{each}_base64"] for each in ("certificate", "private_key"))
                issued = Issued(*map(base64.b64decode, parts))
            self._write_router(system, name, issued)

    def _write_router(self, system: System, name: str, issued: Issued) -> None:
        holder = system.holders[name]
        holders = {
            each.common_name(known): (known, rights_of(known, each.role, system.namespace))
            for known, each in system.valid().items()
            if each.role.kind != ROUTER
        }
        routers = tuple(each.common_name(known) for known, each in system.routers().items())
        content = router_file(
            system.namespace,
            issued,
            self.authority,
            listen=f"tls/0.0.0.0:{system.port}#so_sndbuf={SEND_BUFFER}",
            connect=holder.connect,
            holders=holders,
            routers=routers,
            nodes=[
                known for known, each in system.valid().items() if each.role.kind not in NO_NODES
            ],
        )
        file = self.folder.router_file_of(name)
        self.folder.write_private(file, f"Configuration of the router {name}", content)

    def _credentials(self, system: System, name: str, role: Role, issued: Issued) -> dict[str, Any]:
        tls = {
            CA: base64_of(self.authority.certificate),
            CERTIFICATE: base64_of(issued.certificate),
            KEY: base64_of(issued.key),
            **MUTUAL,
        }
        about = {
            "name": name,
            "namespace": system.namespace,
            "role": role.kind,
            "rights": rights_of(name, role, system.namespace).to_map(),
        }
        return {
            "mode": "client",
            "connect": {"endpoints": [system.endpoint]},
            "scouting": {"multicast": {"enabled": False}, "gossip": {"enabled": False}},
            "transport": {"shared_memory": {"enabled": False}, "link": {"tls": tls}},
            "metadata": {METADATA: about},
        }
