"""The folder of a system's certificates: files that are replaced as a whole or not at all."""

from __future__ import annotations

import fcntl
import json
import os
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any, Final

import zenoh

from zenoh_vision.error_text import joined, suggestion
from zenoh_vision.errors import ConfigurationError, SourceError, VisionError
from zenoh_vision.security.credentials import (
    CA,
    ROUTER_FILE,
    SUFFIX,
    read_json5,
    read_private,
    renewal_of,
)
from zv.tools.security.authority import Issued, base64_of, belong_together
from zv.tools.security.roles import KINDS, ROUTER, Role

LIST: Final = "security.json"
AUTHORITY: Final = "ca.pem"
AUTHORITY_KEY: Final = "ca.key"
COMPOSE: Final = "compose.env"

PUBLIC, PRIVATE = 0o644, 0o600


@dataclass(frozen=True, slots=True)
class Holder:
    """Somebody who has, or had, a certificate.

    Attributes:
        role: What it is.
        ends_s: Until when its newest certificate is valid, s since 1970.
        number: Counts the names that it had: after a revocation, another one is certified, since
            the certificate that was lost would else be as good as the new one.
        hosts: Names and addresses, of a router.
        connect: Endpoints of other routers that a router connects to.
        revoked_s: When its certificates were revoked; None if they are not.
    """

    role: Role
    ends_s: float
    number: int = 1
    hosts: tuple[str, ...] = ()
    connect: tuple[str, ...] = ()
    revoked_s: float | None = None

    def common_name(self, name: str) -> str:
        """Return the name in its certificate, by which the access rules know it."""
        return name if self.number == 1 else f"{name}.{self.number}"


@dataclass(frozen=True, slots=True)
class System:
    """What ``security.json`` says.

    Attributes:
        endpoint: Where nodes find the router.
        port: Where routers listen.
        days: How long certificates are valid.
        holders: By name.
    """

    namespace: str
    endpoint: str
    port: int
    days: int
    holders: Mapping[str, Holder] = field(default_factory=dict)

    def valid(self) -> dict[str, Holder]:
        """Return the holders whose certificates are not revoked."""
        known = sorted(self.holders.items())  # so that equal systems have equal rules
        return {name: each for name, each in known if each.revoked_s is None}

    def routers(self) -> dict[str, Holder]:
        """Return the routers among them."""
        return {name: each for name, each in self.valid().items() if each.role.kind == ROUTER}

    def holder(self, name: str) -> Holder:
        """Return a holder whose certificates are not revoked.

        Raises:
            ConfigurationError: There is none; the text has those that there are.
        """
        found = self.holders.get(name)
        if found is None:
            hint = suggestion(name, self.valid(), after=" ")
            raise ConfigurationError(
                f"nobody is called {name}; {hint}allowed: {joined(self.valid())}"
            )
        if found.revoked_s is not None:
            words = (
                f"--node {name}" if found.role.kind != ROUTER else f"--router {name} --host HOST"
            )
            raise ConfigurationError(
                f"{name} is revoked; zv security add {words} gives it another certificate"
            )
        return found

    def with_holder(self, name: str, holder: Holder) -> System:
        """Return the system with a holder added or replaced."""
        return replace(self, holders={**self.holders, name: holder})


class Folder:
    """Reads and writes the files of one system."""

    def __init__(self, path: str) -> None:
        self.path = Path(path)

    def file_of(self, name: str) -> Path:
        """Return the path of somebody's credentials."""
        return self.path / f"{name}{SUFFIX}"

    def browser_file_of(self, name: str) -> Path:
        """Return the path of the certificate and key that somebody's browser imports."""
        return self.path / f"{name}.p12"

    def router_file_of(self, name: str) -> Path:
        """Return the path of a router's configuration.

        Its folder is its own, since a container sees that a file in a folder was replaced, but not
        that a single file was.
        """
        return self.path / name / ROUTER_FILE

    @contextmanager
    def locked(self) -> Iterator[None]:
        """Keep other commands from changing the folder meanwhile.

        Raises:
            SourceError: There is no such folder, or it has no authority.
        """
        with ExitStack() as cleanup:
            try:
                self._lock(cleanup)
                (self.path / AUTHORITY).stat()
            except OSError as error:
                raise self._unreadable(AUTHORITY, error) from None
            yield

    def _lock(self, cleanup: ExitStack) -> None:
        number = os.open(self.path, os.O_RDONLY)
        cleanup.callback(os.close, number)
        fcntl.flock(number, fcntl.LOCK_EX)

    def system(self) -> System:
        """Read the list of holders.

        Raises:
            SourceError: There is none, or it cannot be read.
            ConfigurationError: It is damaged.
        """
        file = self.path / LIST
        try:
            content = json.loads(file.read_text())
            holders = {str(name): _holder(each) for name, each in content["holders"].items()}
            return System(
                str(content["namespace"]),
                str(content["endpoint"]),
                int(content["port"]),
                int(content["days"]),
                holders,
            )
        except OSError as error:
            raise self._unreadable(LIST, error) from None
        except (ValueError, KeyError, TypeError, AttributeError, RecursionError):
            raise ConfigurationError(
                f"{file}: damaged; copy it back from a backup, or make another folder with "
                "zv security init"
            ) from None

    def authority(self) -> Issued:
        """Read the certificate authority.

        Raises:
            SourceError: A file of it is missing.
            ConfigurationError: Others can read its key, the files do not belong together, or are
                those of another system.
        """
        certificate, key = self.path / AUTHORITY, self.path / AUTHORITY_KEY
        if not key.is_file():
            raise SourceError(
                f"{key}: the authority's key is not here; if it is kept elsewhere, put it back to "
                "issue certificates"
            )
        found = Issued(certificate.read_bytes(), read_private(key).encode())
        try:
            if belong_together(found):
                self._check_in_use(found)
                return found
            said = "is not that of"
        except ValueError:
            said = "cannot be read, or"
        raise ConfigurationError(f"{key}: the key {said} the certificate {certificate}")

    def _check_in_use(self, authority: Issued) -> None:
        """Check that routers know this authority: with another, nobody would be let in any more."""
        for file in self.path.glob(f"*/{ROUTER_FILE}"):
            known = None
            with suppress(VisionError, KeyError, TypeError):  # told by who needs the file
                known = read_json5(file)["transport"]["link"]["tls"][CA]
            if known is not None and known != base64_of(authority.certificate):
                raise ConfigurationError(
                    f"{self.path / AUTHORITY}: not the authority of {file}, perhaps that of "
                    "another system; copy it and its key back from a backup"
                )

    @contextmanager
    def router(self, name: str) -> Iterator[dict[str, Any]]:
        """Yield the configuration of a router, whose parts are then read.

        Raises:
            SourceError: It cannot be read.
            ConfigurationError: Others can read it, it is damaged, or a part is none.
        """
        file = self.router_file_of(name)
        if not file.is_file():
            raise SourceError(f"{file}: no such file; {renewal_of(file)} writes it again")
        found = read_json5(file)
        try:
            yield found
        except (KeyError, TypeError, ValueError, zenoh.ZError):
            again = f"{renewal_of(file)} writes it again"
            raise ConfigurationError(f"{file}: damaged; {again}") from None

    def write(self, system: System) -> None:
        """Write the list of holders."""
        holders = {name: asdict(each) for name, each in sorted(system.holders.items())}
        content = {**asdict(system), "holders": holders}
        self.put(self.path / LIST, json.dumps(content, indent=2) + "\n", PUBLIC)

    def write_private(self, file: Path, about: str, content: Mapping[str, Any]) -> None:
        """Write a JSON5 file with a private key."""
        text = f"// {about}. It holds a private key: nobody else may read it.\n"
        self.put(file, f"{text}{json.dumps(content, indent=2)}\n", PRIVATE)

    def put(self, target: Path, content: str | bytes, mode: int) -> None:
        """Replace a file by a complete new one, or leave it as it is.

        Raises:
            SourceError: It cannot be written.
        """
        temporary = None
        try:
            if not target.parent.exists():
                target.parent.mkdir(mode=0o700)
                self._keep_owner(target.parent)
            number, temporary = tempfile.mkstemp(dir=target.parent, prefix=f".{target.name}.")
            with os.fdopen(number, "wb") as file:  # readable by its owner only, from the beginning
                file.write(content.encode() if isinstance(content, str) else content)
                file.flush()
                os.fsync(file.fileno())
            self._keep_owner(temporary)
            Path(temporary).chmod(mode)
            Path(temporary).replace(target)
        except OSError as error:
            if temporary is not None:
                with suppress(OSError):
                    Path(temporary).unlink()
            raise SourceError(
                f"{target}: {error.strerror or error}; the file is as it was before"
            ) from None

    def _keep_owner(self, path: str | Path) -> None:
        """Give what root writes to the owner of the folder, as whom nodes and containers read."""
        if os.geteuid() == 0:
            about = self.path.stat()
            os.chown(path, about.st_uid, about.st_gid)

    @contextmanager
    def made(self) -> Iterator[None]:
        """Make the folder, which must not have been used, and keep other commands out of it.

        Raises:
            ConfigurationError: It has files.
            SourceError: It cannot be made, or an init was not finished.
        """
        with ExitStack() as cleanup:
            try:
                self.path.mkdir(mode=0o755, parents=True, exist_ok=True)
                self._lock(cleanup)
                listed, begun = self._has(LIST), self._has(AUTHORITY, AUTHORITY_KEY)
            except OSError as error:
                raise SourceError(f"{self.path}: {error.strerror or error}") from None
            if begun and not listed:
                raise self._missing(LIST)
            if listed:
                raise ConfigurationError(
                    f"{self.path}: has the certificates of a system already, and nothing is "
                    "overwritten; zv security add adds to them"
                )
            yield

    def remove(self, name: str) -> None:
        """Delete somebody's file, and that for a browser.

        Raises:
            SourceError: One cannot be deleted.
        """
        for file in (self.file_of(name), self.browser_file_of(name)):
            try:
                file.unlink(missing_ok=True)
            except OSError as error:
                raise SourceError(
                    f"{file}: {error.strerror or error}; the certificate is revoked, delete the "
                    "rest yourself"
                ) from None

    def _has(self, *names: str) -> bool:
        return any((self.path / name).exists() for name in names)

    def _unreadable(self, name: str, error: OSError) -> SourceError:
        if isinstance(error, FileNotFoundError):
            return self._missing(name)
        return SourceError(f"{self.path / name}: {error.strerror or error}")

    def _missing(self, name: str) -> SourceError:
        why = "zv security init makes the folder"
        if self._has(LIST):
            why = "copy it back from a backup, or make another folder with zv security init"
        elif self._has(AUTHORITY, AUTHORITY_KEY):
            name = LIST  # which init writes last
            why = (
                f"an init that was not finished: delete {self.path} and begin again; if it was in "
                "use, copy the file back from a backup"
            )
        return SourceError(f"{self.path / name}: no such file; {why}")


def _holder(fields: Mapping[str, Any]) -> Holder:
    role = fields["role"]
    if role["kind"] not in KINDS:
        raise ValueError("no such role")
    several = {name: tuple(map(str, each)) for name, each in role.items() if name != "kind"}
    return Holder(
        Role(str(role["kind"]), **several),
        float(fields["ends_s"]),
        int(fields["number"]),
        tuple(map(str, fields["hosts"])),
        tuple(map(str, fields["connect"])),
        None if fields["revoked_s"] is None else float(fields["revoked_s"]),
    )
