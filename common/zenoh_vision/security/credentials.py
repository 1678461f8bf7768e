"""Reads a node's credentials: certificate, key and rights, in one JSON5 file."""

from __future__ import annotations

import base64
import binascii
import json
import re
import stat
import time
from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Final

from zenoh_vision.error_text import shortened
from zenoh_vision.errors import ConfigurationError, SourceError
from zenoh_vision.security.rights import Rights

SUFFIX: Final = ".json5"
ROUTER_FILE: Final = f"router{SUFFIX}"
METADATA: Final = "zenoh_vision"
"""The entry of Zenoh's ``metadata`` with the name, the namespace, the role and the rights."""

CA: Final = "root_ca_certificate_base64"
CERTIFICATE: Final = "connect_certificate_base64"
KEY: Final = "connect_private_key_base64"
OTHERS: Final = stat.S_IRWXG | stat.S_IRWXO

WARN_S: Final = 30 * 24 * 3600
"""How long before its end a certificate is warned about."""

DAY_S: Final = 24 * 3600


@dataclass(frozen=True, slots=True)
class Validity:
    """When a certificate is valid, and what is said of that.

    Attributes:
        name: Whom it names.
        folder: Where it was made.
        begins_s: From when it is valid, s since 1970.
        ends_s: Until when.
    """

    name: str
    folder: Path
    begins_s: float
    ends_s: float

    def fault(self, now_s: float | None = None) -> str:
        """Return why the certificate is not valid now, with what to do; empty if it is."""
        now_s = time.time() if now_s is None else now_s
        clock = f"this machine's clock says {shown_time(now_s)}"
        if now_s < self.begins_s:
            return (
                f"the certificate of {self.name} is valid from {shown_time(self.begins_s)} only, "
                f"and {clock}: set the clock"
            )
        if now_s > self.ends_s:
            return (
                f"the certificate of {self.name} ended {shown_time(self.ends_s)}, and {clock}: "
                f"{renewal(self.folder, self.name)}, unless the clock is wrong"
            )
        return ""

    def warning(self, now_s: float | None = None) -> str:
        """Return that the certificate ends within 30 days; empty if it does not."""
        left_s = self.ends_s - (time.time() if now_s is None else now_s)
        if not 0 <= left_s < WARN_S:
            return ""
        return (
            f"the certificate of {self.name} ends {shown_time(self.ends_s)}, in "
            f"{left_s / DAY_S:.0f} days: {renewal(self.folder, self.name)}"
        )


@dataclass(frozen=True, slots=True)
class Credentials:
    """Who a program is to the router, and what it may do.

    Attributes:
        path: The file.
        name: Whom the certificate names.
        namespace: First chunk of the keys of its rights.
        endpoint: Where the router is, unless another endpoint is given.
        tls: Zenoh's table ``transport/link/tls``, with the private key.
        rights: As they were when the file was written; the router's rules decide.
        validity: When the certificate is valid.
    """

    path: Path
    name: str
    namespace: str
    endpoint: str
    tls: Mapping[str, Any] = field(repr=False)
    rights: Rights
    validity: Validity

    def pem(self, part: str) -> bytes:
        """Return a part of the TLS table, such as ``CERTIFICATE``, as PEM."""
        return base64.b64decode(self.tls[part])


def renewal(folder: Path, name: str) -> str:
    """Return the command that gives somebody another certificate."""
    return f"zv security renew {name} --dir {folder}"


def renewal_of(file: Path) -> str:
    """Return the command that writes somebody's file again; that of a router has its own folder."""
    if file.name == ROUTER_FILE:
        folder = file.absolute().parent  # it may be the current one
        return renewal(folder.parent, folder.name)
    return renewal(file.parent, file.stem)


def shown_time(time_s: float) -> str:
    """Return a time for people, in UTC."""
    return datetime.fromtimestamp(time_s, UTC).strftime("%Y-%m-%d %H:%M UTC")


def without_clock(text: str) -> str:
    """Return what is said of a certificate without the time of this machine's clock.

    That goes on each minute, and says nothing new.
    """
    return re.sub(r"(clock[a-z, ]* says )[0-9-]+ [0-9:]+ UTC", r"\1", text)


def credentials_file(path: str) -> Path:
    """Return the file that a path names, which may leave out the suffix.

    That of a router is in a folder of its own, which may be named instead.

    Raises:
        SourceError: There is none.
        ConfigurationError: It is a folder.
    """
    given = Path(path)
    for each in (given, Path(f"{given}{SUFFIX}"), given / ROUTER_FILE):
        if each.is_file():
            return each
    if given.is_dir():
        names = sorted(each.stem for each in given.glob(f"*{SUFFIX}"))
        there = ", ".join(f"{given / name}" for name in names) or "none"
        raise ConfigurationError(f"credentials {path}: a folder; allowed: a file: {there}")
    raise SourceError(
        f"credentials {path}: no such file; zv security init writes those of a system, "
        "zv security add those of others, and zv security renew those that were lost"
    )


def file_state(file: Path) -> tuple[int, ...] | None:
    """Return what changes when a file, or who may read it, does; None while there is no file."""
    try:
        about = file.stat()
    except OSError:
        return None
    return about.st_mtime_ns, about.st_size, about.st_ino, about.st_mode


def read_private(path: Path) -> str:
    """Return the text of a file that holds a private key.

    Raises:
        SourceError: It cannot be read.
        ConfigurationError: Others can read it.
    """
    try:
        mode = path.stat().st_mode
        text = path.read_text(errors="replace")
    except OSError as error:
        raise SourceError(f"{path}: {error.strerror or error}") from None
    if mode & OTHERS:
        raise ConfigurationError(
            f"{path}: its mode is {stat.S_IMODE(mode):04o}, so others can use its private key; "
            f"allowed: 0600; chmod 600 {path}"
        )
    return text


def read_json5(path: Path) -> dict[str, Any]:
    """Return the content of a file of ``zv security``: a comment, then JSON.

    Raises:
        SourceError: It cannot be read.
        ConfigurationError: Others can read it, or it is cut short or damaged.
    """
    return parsed_json5(path, read_private(path))


def parsed_json5(path: Path, text: str) -> dict[str, Any]:
    """Return the content in the text of such a file.

    Raises:
        ConfigurationError: It is cut short or damaged.
    """
    lines = text.split("\n")
    try:
        content = json.loads("\n".join(line for line in lines if not line.startswith("//")))
    except (ValueError, RecursionError):
        content = None
    if not isinstance(content, dict) and path.suffix != SUFFIX:
        raise ConfigurationError(
            f"{path}: no credentials; allowed: DIR/NAME{SUFFIX}, which zv security writes"
        )
    if not isinstance(content, dict):
        raise ConfigurationError(
            f"{path}: cut short or damaged; {renewal_of(path)} writes it again"
        )
    return content


def read_credentials(path: str) -> Credentials:
    """Read a node's credentials, and check that their parts belong together.

    Raises:
        SourceError: There is no such file, or it cannot be read.
        ConfigurationError: Others can read it, it is damaged, or its key or its authority is that
            of another certificate. The text says how to mend it.
    """
    file = credentials_file(path)
    content = read_json5(file)
    again = f"{renewal_of(file)} writes it again"
    try:
        about = content["metadata"][METADATA]
        tls = content["transport"]["link"]["tls"]
        name, namespace = (str(about[each]) for each in ("name", "namespace"))
        (endpoint,) = content["connect"]["endpoints"]
        times_s = _checked_certificate(tls, file)
    except (KeyError, TypeError, ValueError, binascii.Error) as error:
        said = shortened(str(error)) if isinstance(error, KeyError) else "a wrong value"
        raise ConfigurationError(f"{file}: no credentials of a node ({said}); {again}") from None
    rights = Rights.from_map(about.get("rights"))
    validity = Validity(name, file.parent, *times_s)
    return Credentials(file, name, namespace, str(endpoint), tls, rights, validity)


def _checked_certificate(tls: Mapping[str, Any], file: Path) -> tuple[float, float]:
    """Return from when and until when the certificate is valid, s since 1970."""
    # Only programs with credentials load it.
    from cryptography import x509
    from cryptography.exceptions import InvalidSignature
    from cryptography.hazmat.primitives.serialization import load_pem_private_key

    certificate = x509.load_pem_x509_certificate(base64.b64decode(tls[CERTIFICATE]))
    authority = x509.load_pem_x509_certificate(base64.b64decode(tls[CA]))
    key = load_pem_private_key(base64.b64decode(tls[KEY]), None)
    again = f"{renewal_of(file)} makes both again"
    if key.public_key() != certificate.public_key():
        raise ConfigurationError(f"{file}: the private key is not the certificate's; {again}")
    try:
        certificate.verify_directly_issued_by(authority)
    except (InvalidSignature, ValueError, TypeError):
        raise ConfigurationError(
            f"{file}: the certificate was not issued by the authority in it; {again}"
        ) from None
    return (
        certificate.not_valid_before_utc.timestamp(),
        certificate.not_valid_after_utc.timestamp(),
    )
