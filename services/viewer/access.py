"""Who may ask: by the name of the host that they ask for, where they come from, a token."""

from __future__ import annotations

import hmac
import ipaddress
import logging
import os
import re
import secrets
import socket
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from urllib.parse import urlsplit

log = logging.getLogger("viewer")

COOKIE = "zv_token"
TOKEN_BYTES = 24
NAME = re.compile(r"[a-z0-9_.-]{1,100}")
TOKEN = re.compile(r"[A-Za-z0-9_.~-]{16,128}")
PORT = re.compile(r":([0-9]{1,5})$")

SECURITY_HEADERS = {
    "Content-Security-Policy": "default-src 'none'; script-src 'self'; style-src 'self'; "
    "img-src 'self' blob: data:; connect-src 'self'; manifest-src 'self'; base-uri 'none'; "
    "form-action 'none'; frame-ancestors 'none'",
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
}


class Refused(Exception):
    """A request that is not answered.

    Attributes:
        status: 401 or 403.
        reason: One line.
    """

    def __init__(self, status: int, reason: str) -> None:
        super().__init__(reason)
        self.status = status
        self.reason = reason


@dataclass(frozen=True, slots=True)
class Access:
    """The rules of one viewer.

    Attributes:
        token: What a browser must know; None if none is asked for.
        names: Names of hosts under which it may be asked for, besides addresses.
    """

    token: str | None = field(repr=False)
    names: frozenset[str]

    def check_host(self, host: str | None) -> None:
        """Refuse a request for another host: a foreign name that was made to lead here.

        Args:
            host: The ``Host`` header.

        Raises:
            Refused: 403.
        """
        name = host_name(host or "")
        if name in self.names or is_address(name):
            return
        shown = name if NAME.fullmatch(name) else "NAME"
        raise Refused(403, f"host {host!r} is not served here; --allow-host {shown} would allow it")

    def check_origin(self, origin: str | None, host: str | None) -> None:
        """Refuse what a page of another site asks for; who is no browser sends no origin.

        Args:
            origin: The ``Origin`` header.
            host: The ``Host`` header.

        Raises:
            Refused: 403.
        """
        if origin is not None and place_of(origin) != (host or "").lower():
            raise Refused(403, f"a page of {origin!r} may not ask this; allowed: one of {host!r}")

    def check_token(self, given: Mapping[str, str | None]) -> None:
        """Refuse one who does not know the token.

        Args:
            given: What was given, by where: ``query``, ``cookie``, ``bearer``.

        Raises:
            Refused: 401.
        """
        if self.token is None or any(self.knows(text) for text in given.values()):
            return
        wrong = any(text is not None for text in given.values())
        raise Refused(
            401,
            f"{'the token is wrong' if wrong else 'a token is needed'}: "
            "open the address that `zv view` prints, or add ?token=TOKEN",
        )

    def knows(self, text: str | None) -> bool:
        """Tell whether a text is the token, in a time that says nothing about it."""
        if self.token is None or text is None:
            return False
        given = text.encode(errors="surrogateescape")  # a header may hold any byte
        return hmac.compare_digest(given, self.token.encode())


def place_of(origin: str) -> str:
    """Return host and port of an ``Origin`` header, in lower case; nothing if it has none."""
    try:
        return urlsplit(origin).netloc.lower()
    except ValueError:
        return ""


def host_name(host: str) -> str:
    """Return the name or address in a ``Host`` header, without its port, in lower case."""
    host = host.strip().lower()
    if host.startswith("["):
        return host[1:].partition("]")[0]
    return host.partition(":")[0].removesuffix(".")


def cookie_name(host: str | None) -> str:
    """Return the name of the cookie that holds the token of the viewer at a host and port.

    Browsers send a host's cookies to all its ports, so that two viewers on one machine would
    take each other's away if they had one name. The port is the one that the browser knows, not
    ours: it differs outside of a container.

    Args:
        host: The ``Host`` header.
    """
    port = PORT.search((host or "").strip())
    return f"{COOKIE}_{port[1]}" if port else COOKIE


def is_address(name: str) -> bool:
    """Tell whether a name is an IP address: one that needs no name server, which may lie."""
    try:
        ipaddress.ip_address(name)
    except ValueError:
        return False
    return True


def is_loopback(host: str) -> bool:
    """Tell whether only this machine reaches an address."""
    if host.lower() == "localhost":
        return True
    return is_address(host) and ipaddress.ip_address(host).is_loopback


def own_names(host: str, allow_host: str) -> frozenset[str]:
    """Return the names under which a viewer may be asked for.

    Args:
        host: Where it listens.
        allow_host: More names, with commas between.
    """
    own = socket.gethostname().lower()
    names = {"localhost", own, f"{own.partition('.')[0]}.local", host.lower()}
    return frozenset(names | {name for name in allow_host.lower().split(",") if name})


def token_for(host: str, given: str | None, folder: Path | None = None) -> str | None:
    """Return the token that a viewer on this address asks for; None if it asks for none.

    Args:
        host: Where it listens.
        given: By the settings.
        folder: Where one is kept that was made here; None for the user's state folder.
    """
    if given is not None:
        return given
    if is_loopback(host):
        return None
    path = (folder or state_folder()) / "viewer_token"
    try:
        return kept_token(path)
    except OSError as error:
        log.warning("the token holds for this run only: %s: %s", path, error.strerror or error)
        return secrets.token_urlsafe(TOKEN_BYTES)


def kept_token(path: Path) -> str:
    """Return the token in a file, which is made if there is none in it.

    Raises:
        OSError: It can be neither read nor written.
    """
    try:
        text = path.read_text(errors="replace").strip()
    except FileNotFoundError:
        text = ""
    if TOKEN.fullmatch(text):
        path.chmod(0o600)
        return text
    path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
    token = secrets.token_urlsafe(TOKEN_BYTES)
    path.unlink(missing_ok=True)
    descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
    with os.fdopen(descriptor, "w") as file:
        file.write(token + "\n")
    return token


def state_folder() -> Path:
    """Return the folder in which this user's programs keep such things."""
    stated = os.environ.get("XDG_STATE_HOME", "")
    base = Path(stated) if stated.startswith("/") else Path("~/.local/state").expanduser()
    return base / "zenoh-vision"
