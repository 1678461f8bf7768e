"""``zv security web``: a certificate for the viewer's TLS, and those of people for browsers."""

from __future__ import annotations

import shlex
from collections.abc import Iterable
from typing import Any, Final

from cryptography import x509
from cryptography.hazmat.primitives.serialization import (
    NoEncryption,
    load_pem_private_key,
    pkcs12,
)

from zenoh_vision.errors import ConfigurationError
from zenoh_vision.security.credentials import CA, CERTIFICATE, KEY, read_credentials, shown_time
from zenoh_vision.transport.connection import Connection
from zv.tools.security.authority import issue
from zv.tools.security.folder import AUTHORITY, PRIVATE, Folder, System
from zv.tools.security.issuing import HERE
from zv.tools.security.options import HOST, WebOptions
from zv.tools.security.roles import GUEST, OPERATOR, ROUTER
from zv.tools.shared.output import Output

FILE: Final = "web.pem"
VIEWER: Final = "viewer"
NAME: Final = "viewer-web"
"""Whom the viewer's certificate names: nobody who has rights at a router."""


def web(options: WebOptions, _connection: Connection, output: Output) -> None:
    """Write the viewer's certificate with its key, and a file for the browser of each person.

    Raises:
        ConfigurationError: Nobody has one of the names, or it is no person's.
        SourceError: A file cannot be read or written.
    """
    folder = Folder(options.dir)
    with folder.locked():
        system, authority = folder.system(), folder.authority()
        people = list(_people(system, options.name))
        hosts = tuple(dict.fromkeys((*(options.host or system.holders[ROUTER].hosts), *HERE)))
        own = issue(authority, NAME, hosts, system.days)
        files = [folder.path / FILE]
        text = f"{own.certificate.decode()}{own.key.decode()}"
        folder.put(files[0], text, PRIVATE)
        for name in people:
            files.append(folder.browser_file_of(name))
            folder.put(files[-1], _for_browser(folder, name), PRIVATE)
    names = ",".join(system.holders[name].common_name(name) for name in people)
    called = [each for each in hosts if HOST.fullmatch(each) and each not in HERE]
    allowed = f" --allow-host {','.join(called)}" if called else ""
    valid = system.valid().items()
    admitted = "".join(
        f" --tls-{kind}s {shlex.quote(','.join(all_of))}"
        for kind in (OPERATOR, GUEST)
        if (all_of := [each.common_name(name) for name, each in valid if each.role.kind == kind])
        != [kind]  # which is the default
    )
    for name in people:
        if fault := read_credentials(str(folder.file_of(name))).validity.fault():
            output.note(f"browsers with {folder.browser_file_of(name)} are not let in: {fault}")
    output.result(
        {"written": [str(file) for file in files], "names": names},
        *(f"wrote {file}" for file in files),
        f"{files[0]} is valid until {shown_time(own.ends_s)}, for {', '.join(hosts)}",
        "next:",
        f"  zv view --host 0.0.0.0{allowed} --credentials {folder.path / VIEWER} "
        f"--tls-certificate {files[0]} --tls-clients {folder.path / AUTHORITY}{admitted}",
        f"  import {folder.path / AUTHORITY}, and a .p12 without a password, in browsers",
    )


def _people(system: System, names: Iterable[str]) -> Iterable[str]:
    persons = [name for name, each in system.valid().items() if each.role.kind in (OPERATOR, GUEST)]
    for name in names:
        system.holder(name)
        if name not in persons:
            raise ConfigurationError(
                f"{name} is no person; allowed: {', '.join(persons) or 'none'}"
            )
    return names or persons


def _for_browser(folder: Folder, name: str) -> bytes:
    found = read_credentials(str(folder.file_of(name)))
    key: Any = load_pem_private_key(found.pem(KEY), None)
    own, authority = (x509.load_pem_x509_certificate(found.pem(each)) for each in (CERTIFICATE, CA))
    return pkcs12.serialize_key_and_certificates(
        name.encode(), key, own, [authority], NoEncryption()
    )
