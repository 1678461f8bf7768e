"""The credentials and access rules of a router, which may be replaced while it runs."""

from __future__ import annotations

import base64
import logging
import math
import time
from pathlib import Path
from typing import Final

import zenoh

from zenoh_vision.errors import ConfigurationError, VisionError
from zenoh_vision.security.credentials import (
    Validity,
    credentials_file,
    parsed_json5,
    read_private,
    without_clock,
)
from zenoh_vision.transport.zenoh_config import router_config

log = logging.getLogger("router")

LOOK_S: Final = 1.0
"""How often the file is read."""

SERVES: Final = "listen_certificate_base64"

RETRY_S: Final = 10.0
"""After which rules are tried again with which the system ran no router, as on a port in use."""


class RouterRules:
    """Watches the file of ``zv security`` for a router.

    The text is compared, not the file's times, and the configuration is made of the same text that
    was checked: whenever the file is replaced, the router runs with a whole one, and then with the
    last one.

    Args:
        credentials: The file, perhaps without its suffix.
        listen: Endpoint, unless the file has others.

    Attributes:
        config: Of the newest text that can be used.
        fault: Why a changed file cannot be used; empty if it can. The former rules hold then.

    Raises:
        SourceError: There is no such file.
        ConfigurationError: It cannot be used, or others can read it.
    """

    def __init__(self, credentials: str, listen: str) -> None:
        self.path = credentials_file(credentials)
        self.fault = ""
        self._listen = listen
        self._text = read_private(self.path)
        self.config = self._config(self._text)
        self._judged: str | None = None  # the text with the certificate of this validity
        self._validity: Validity | None = None
        self._said = ""
        self._former: tuple[str, zenoh.Config] | None = None
        self._rejected = ""
        self._retry_s = math.inf
        self._look_s = 0.0

    def changed(self) -> bool:
        """Tell whether the file has changed, and can be used."""
        if time.monotonic() < self._look_s:
            return False
        self._look_s = time.monotonic() + LOOK_S
        try:
            text = read_private(self.path)
            if text == self._rejected and time.monotonic() < self._retry_s:
                return False
            config = self.config if text == self._text else self._config(text)
        except VisionError as error:
            self._hold(error)
            return False
        self.fault = self._rejected = ""
        if text == self._text:
            return False
        self._former = self._text, self.config
        self._text, self.config = text, config
        return True

    def trouble(self) -> str:
        """Return why a changed file cannot be used, or why the router's certificate lets nobody in.

        Logs that this certificate ends within 30 days, or is not valid now.
        """
        if self._judged is not self._text:
            self._judged, self._validity = self._text, _validity(self.path, self._text)
        ended, ending = "", ""
        if self._validity is not None:
            ended, ending = self._validity.fault(), self._validity.warning()
        said = ended or ending
        if said and without_clock(said) != without_clock(self._said):
            log.log(logging.ERROR if ended else logging.WARNING, "%s", said)
        self._said = said
        return self.fault or ended

    def reject(self, error: VisionError) -> bool:
        """Return to the former rules, since no router can run with these; False without former.

        What only the system refuses is tried again: the former rules let in who was revoked.
        """
        if self._former is None:
            return False
        self._rejected = self._text
        self._retry_s = time.monotonic() + RETRY_S if "os error" in str(error) else math.inf
        self._text, self.config = self._former
        self._former = None
        self._hold(error)
        return True

    def _hold(self, error: VisionError) -> None:
        fault = f"the former rules hold: {error}"
        if fault != self.fault:
            self.fault = fault
            log.error("%s", fault)

    def _config(self, text: str) -> zenoh.Config:
        if not isinstance(parsed_json5(self.path, text).get("access_control"), dict):
            raise ConfigurationError(
                f"{self.path}: no configuration of a router; allowed: DIR/router, which "
                "zv security init writes"
            )
        return router_config(self._listen, str(self.path), text)


def _validity(file: Path, text: str) -> Validity | None:
    """Return when a router's certificate is valid; None for a file without one of zv security."""
    from cryptography import x509
    from cryptography.x509.oid import NameOID

    try:
        pem = base64.b64decode(parsed_json5(file, text)["transport"]["link"]["tls"][SERVES])
        found = x509.load_pem_x509_certificate(pem)
        (named,) = found.subject.get_attributes_for_oid(NameOID.COMMON_NAME)
    except (VisionError, KeyError, TypeError, ValueError):
        return None
    name = str(named.value).partition(".")[0]  # after a revocation it is router.2
    times = found.not_valid_before_utc.timestamp(), found.not_valid_after_utc.timestamp()
    return Validity(name, file.absolute().parent.parent, *times)
