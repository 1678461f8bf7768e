"""The token that browsers must present: from the settings, or generated and kept in a file."""

from __future__ import annotations

import logging
import os
import re
import secrets
from pathlib import Path

from zv.viewer.http.listener import is_loopback
from zv.viewer.settings import TOKEN_PATTERN, ViewerSettings

log = logging.getLogger("viewer")

TOKEN_BYTES = 24


def token_of(settings: ViewerSettings) -> str | None:
    """Return the token that a viewer requires; None if it requires none, or a certificate.

    A generated one is kept in the user's state folder.
    """
    is_local = all(map(is_loopback, (settings.host, *settings.names)))
    if settings.token is not None or settings.tls_clients is not None or is_local:
        return settings.token
    path = state_folder() / "viewer_token"
    try:
        return stored_token(path)
    except OSError as error:
        log.warning("the token is valid for this run only: %s: %s", path, error.strerror or error)
        return secrets.token_urlsafe(TOKEN_BYTES)


def stored_token(path: Path) -> str:
    """Return the token in a file; generate and store one if the file has none."""
    try:
        text = path.read_text(errors="replace").strip()
    except FileNotFoundError:
        text = ""
    if re.fullmatch(TOKEN_PATTERN, text):
        path.chmod(0o600)
        return text
    path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
    token = secrets.token_urlsafe(TOKEN_BYTES)
    path.unlink(missing_ok=True)
    path.touch(0o600, exist_ok=False)
    path.write_text(f"{token}\n")
    return token


def state_folder() -> Path:
    """Return the folder of this user's state files, by the XDG specification."""
    configured = os.environ.get("XDG_STATE_HOME", "")
    base = Path(configured) if configured.startswith("/") else Path("~/.local/state").expanduser()
    return base / "zenoh-vision"
