"""Finds out why a router refuses a connection, which Zenoh reports as a router that is not there.

The same TLS handshake is made again, with the standard library, which tells what was wrong.
"""

from __future__ import annotations

import os
import socket
import ssl
import threading
import time
from collections.abc import Callable, Iterable

from zenoh_vision.security.credentials import CA, CERTIFICATE, KEY, Credentials, shown_time
from zenoh_vision.transport.endpoints import TcpEndpoint, tcp_endpoint

TIMEOUT_S = 1.0
AGAIN_S = 3.0

EXPIRED, NOT_YET, WRONG_HOST = 10, 9, (62, 64)
"""Codes of OpenSSL for a certificate that cannot be verified."""

ALERTS = {
    "CERTIFICATE_REQUIRED": "it asks for a certificate",
    "UNKNOWN_CA": "it does not know the authority that issued the certificate of {name}",
    "DECRYPT_ERROR": "it does not know the authority that issued the certificate of {name}",
    "CERTIFICATE_REVOKED": "the certificate of {name} is revoked",
    "BAD_CERTIFICATE": "it does not accept the certificate of {name}",
}


def refusal(endpoints: Iterable[str], credentials: Credentials | None) -> str:
    """Return why the first reachable router refuses a connection; empty if that is unknown.

    Takes at most ``TIMEOUT_S`` for each step of each endpoint.
    """
    if credentials is not None and (fault := credentials.validity.fault()):
        return fault
    for text in endpoints:
        endpoint = tcp_endpoint(text)
        if endpoint is None or endpoint.scheme not in ("tls", "tcp"):
            continue
        if credentials is not None and endpoint.scheme == "tls":
            said = _refused_handshake(endpoint, credentials)
        else:
            said = _needs_tls(endpoint) if credentials is None else ""
        if said:
            return f"the router at {text} refuses: {said}"
    return ""


def router_certificate_ends_s(endpoints: Iterable[str], credentials: Credentials) -> float | None:
    """Return until when the certificate of the first router is valid, s since 1970.

    None if none is reached, or not by TLS.
    """
    for text in endpoints:
        endpoint = tcp_endpoint(text)
        if endpoint is None or endpoint.scheme != "tls":
            continue
        try:
            with _connected(endpoint, _context(credentials)) as connection:
                about = connection.getpeercert() or {}
        except OSError:
            continue
        if "notAfter" in about:
            return float(ssl.cert_time_to_seconds(str(about["notAfter"])))
    return None


def _context(credentials: Credentials) -> ssl.SSLContext:
    context = ssl.create_default_context(cadata=credentials.pem(CA).decode())
    _load(context, credentials)
    return context


def _refused_handshake(endpoint: TcpEndpoint, credentials: Credentials) -> str:
    try:
        with _connected(endpoint, _context(credentials)) as connection:
            connection.settimeout(TIMEOUT_S / 2)
            connection.recv(1)  # with TLS 1.3 the answer to our certificate comes here
    except ssl.SSLCertVerificationError as error:
        return _about_router(error, endpoint, credentials)
    except ssl.SSLError as error:
        return _about_alert(error.reason or "", credentials)
    except OSError:
        return ""  # no router, or one that waits for us to speak: nothing was refused
    return ""


def _about_router(
    error: ssl.SSLCertVerificationError, endpoint: TcpEndpoint, credentials: Credentials
) -> str:
    clock = f"this machine's clock says {shown_time(time.time())}"
    folder = credentials.path.parent
    if error.verify_code == EXPIRED:
        return f"its own certificate has ended, or the clock is wrong ({clock}): " + (
            f"zv security renew router --dir {folder}"
        )
    if error.verify_code == NOT_YET:
        return f"its own certificate is not valid yet, and {clock}: set the clock"
    if error.verify_code in WRONG_HOST:
        return (
            f"its certificate does not name {endpoint.host}: "
            f"zv security renew router --host {endpoint.host} --dir {folder}"
        )
    return "its certificate was issued by another authority than that of " + credentials.name


def _about_alert(reason: str, credentials: Credentials) -> str:
    if "WRONG_VERSION" in reason or "UNEXPECTED_MESSAGE" in reason:
        return "it speaks no TLS; connect with tcp/ and without --credentials, or secure it"
    if "EXPIRED" in reason:  # also for one that is not valid yet
        return (
            f"by its clock the certificate of {credentials.name} is not valid, but by this "
            f"machine's clock, which says {shown_time(time.time())}, it is: compare the clocks"
        )
    for alert, said in ALERTS.items():
        if alert in reason:
            return said.format(name=credentials.name)
    return ""


def _needs_tls(endpoint: TcpEndpoint) -> str:
    """Tell that a router speaks TLS, if it does."""
    context = ssl.create_default_context()
    context.check_hostname = False
    context.verify_mode = ssl.CERT_NONE
    try:
        _connected(endpoint, context).close()
    except OSError:
        return ""
    return "it speaks TLS and asks for a certificate: give --credentials, or ZV_CREDENTIALS"


def _connected(endpoint: TcpEndpoint, context: ssl.SSLContext) -> ssl.SSLSocket:
    plain = socket.create_connection((endpoint.address, endpoint.port), TIMEOUT_S)
    try:
        return context.wrap_socket(plain, server_hostname=endpoint.address)
    except BaseException:
        plain.close()
        raise


def _load(context: ssl.SSLContext, credentials: Credentials) -> None:
    """Load certificate and key, which Python reads from files only; the file is in memory."""
    number = os.memfd_create("credentials", os.MFD_CLOEXEC)
    try:
        os.write(number, credentials.pem(KEY) + credentials.pem(CERTIFICATE))
        context.load_cert_chain(f"/proc/self/fd/{number}")
    finally:
        os.close(number)


class RefusalProbe:
    """Asks why connections fail, on a thread of its own, at most every ``AGAIN_S``.

    Attributes:
        text: The last answer; empty if nothing is known.
    """

    def __init__(self, ask: Callable[[], str]) -> None:
        self.text = ""
        self._ask = ask
        self._due_s = 0.0
        self._thread: threading.Thread | None = None

    def begin(self) -> None:
        """Ask again if that is due; returns at once."""
        asking = self._thread is not None and self._thread.is_alive()
        if asking or time.monotonic() < self._due_s:
            return
        self._due_s = time.monotonic() + AGAIN_S
        self._thread = threading.Thread(target=self._run, name="handshake", daemon=True)
        self._thread.start()

    def _run(self) -> None:
        self.text = self._ask()
