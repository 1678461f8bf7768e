"""The viewer's own TLS: its certificate, and the certificates by which it knows browsers."""

from __future__ import annotations

import ssl
import stat
import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from cryptography import x509

from zenoh_vision.errors import ConfigurationError
from zenoh_vision.security.credentials import file_state, shown_time
from zv.viewer.credentials import Principal, Scope
from zv.viewer.settings import ViewerSettings

ANY: Final = "*"

LAST_PART: Final = 0.1
"""The part of a certificate's validity before its end in which it is warned about."""


@dataclass(frozen=True, slots=True)
class Holders:
    """Whose certificates replace a token, by the names in them; ``*`` is every name."""

    operators: frozenset[str]
    guests: frozenset[str]

    def principal(self, certificate: Mapping[str, Any]) -> Principal | None:
        """Return the sender of a request with this certificate; None if it has no rights here.

        TLS has verified it, once for all requests of a connection, which may outlast its end.

        Args:
            certificate: As ``ssl.SSLSocket.getpeercert`` returns it.
        """
        ends_s = ssl.cert_time_to_seconds(certificate["notAfter"])
        if ends_s <= time.time():
            return None
        pairs = [pair for each in certificate.get("subject", ()) for pair in each]
        name = next((value for kind, value in pairs if kind == "commonName"), "")
        for names, scope in ((self.operators, Scope.CONTROL), (self.guests, Scope.VIEW)):
            if name in names or ANY in names:
                return Principal(scope, f"certificate {name!a} ({scope})", ends_s)
        return None


class ServerTls:
    """Holds what connections are encrypted with, and takes files that are replaced.

    Args:
        settings: With a certificate.

    Attributes:
        context: For ``create_server``. Changed on the thread that calls ``follow``.
        holders: None if no certificate of a browser has rights.

    Raises:
        ConfigurationError: A file cannot be used.
    """

    def __init__(self, settings: ViewerSettings) -> None:
        assert settings.tls_certificate is not None
        self._certificate = Path(settings.tls_certificate)
        self._key = Path(settings.tls_key or settings.tls_certificate)
        self._unusable = ""
        self._state: object = None
        self._validity_s = (0.0, 0.0)
        self.context = ssl.create_default_context(ssl.Purpose.CLIENT_AUTH)
        self.holders: Holders | None = None
        if settings.tls_clients is not None:
            self._trust(Path(settings.tls_clients))
            names = (settings.tls_operators.split(","), settings.tls_guests.split(","))
            self.holders = Holders(*(frozenset(filter(None, each)) for each in names))
        self._load()

    def follow(self) -> None:
        """Take the files if they were replaced; those that cannot be used leave the former."""
        if self._state != self._files():
            self._unusable = ""
            try:
                self._load()
            except ConfigurationError as error:
                self._unusable = f"{error}; the former certificate is in use"

    def warning(self, now_s: float | None = None) -> str:
        """Return what is wrong with the files, or with the time; perhaps empty."""
        now_s = time.time() if now_s is None else now_s
        begins_s, ends_s = self._validity_s
        if not self._unusable and now_s < begins_s:
            return (
                f"tls_certificate {self._certificate}: valid from {shown_time(begins_s)} only, but "
                "this machine's clock is before that; set the clock"
            )
        if self._unusable or now_s < ends_s - LAST_PART * (ends_s - begins_s):
            return self._unusable
        ends = "ends" if now_s < ends_s else "ended"
        return f"tls_certificate {self._certificate}: {ends} {shown_time(ends_s)}; replace the file"

    def _files(self) -> object:
        return file_state(self._certificate), file_state(self._key)

    def _trust(self, file: Path) -> None:
        _read("tls_clients", file)
        try:
            self.context.load_verify_locations(file)
        except ssl.SSLError:
            raise ConfigurationError(
                f"tls_clients {file}: no certificate in it; allowed: PEM, the certificate of the "
                "authority of browsers' certificates"
            ) from None
        # A browser may show a token instead, and needs neither for /healthz.
        self.context.verify_mode = ssl.CERT_OPTIONAL

    def _load(self) -> None:
        self._state = self._files()
        pem = _read("tls_certificate", self._certificate)
        _read("tls_key", self._key)
        if self._key.stat().st_mode & stat.S_IRWXO:
            raise ConfigurationError(
                f"tls_key {self._key}: everybody on this machine can read the key; "
                f"chmod 600 {self._key}"
            )
        try:
            found = x509.load_pem_x509_certificate(pem)
        except ValueError:
            raise ConfigurationError(
                f"tls_certificate {self._certificate}: no certificate in it; allowed: PEM, the "
                "viewer's own first, then those between it and its authority"
            ) from None
        # A context that has refused a key has lost the former one.
        for context in (ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER), self.context):
            self._load_into(context)
        times = found.not_valid_before_utc, found.not_valid_after_utc
        self._validity_s = times[0].timestamp(), times[1].timestamp()

    def _load_into(self, context: ssl.SSLContext) -> None:
        try:
            context.load_cert_chain(self._certificate, self._key, password=_no_password)
        except _EncryptedError:
            said = "the key has a password; allowed: one without"
        except ssl.SSLError as error:
            if "MISMATCH" in (error.reason or ""):
                said = f"the key is not that of the certificate {self._certificate}"
            else:
                said = "no private key in it; allowed: PEM"
        else:
            return
        raise ConfigurationError(f"tls_key {self._key}: {said}")


class _EncryptedError(Exception):
    pass


def _no_password() -> str:
    raise _EncryptedError


def _read(option: str, file: Path) -> bytes:
    try:
        return file.read_bytes()
    except OSError as error:
        raise ConfigurationError(f"{option} {file}: {error.strerror or error}") from None
