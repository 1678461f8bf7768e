"""Issues certificates: an authority of the system's own, and one certificate per holder."""

from __future__ import annotations

import base64
import ipaddress
import math
import time
from collections.abc import Iterable
from dataclasses import dataclass, field
from datetime import UTC, datetime, timedelta
from typing import Final

from cryptography import x509
from cryptography.hazmat.primitives import hashes, serialization
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.x509.oid import ExtendedKeyUsageOID, NameOID

from zenoh_vision.errors import ConfigurationError
from zenoh_vision.security.credentials import shown_time

AUTHORITY_DAYS: Final = 3650
LONGEST_NAME: Final = 64
"""Most characters of a name in a certificate, by X.520."""

BACKDATED: Final = timedelta(minutes=5)
"""Certificates begin this long before they are issued, since clocks differ a little."""


@dataclass(frozen=True, slots=True)
class Issued:
    """A certificate and its private key, as PEM."""

    certificate: bytes
    key: bytes = field(repr=False)

    @property
    def ends_s(self) -> float:
        """Until when it is valid, s since 1970."""
        parsed = x509.load_pem_x509_certificate(self.certificate)
        return parsed.not_valid_after_utc.timestamp()


def base64_of(pem: bytes) -> str:
    """Return PEM in the form of Zenoh's settings that end in ``_base64``."""
    return base64.b64encode(pem).decode()


def new_authority(namespace: str) -> Issued:
    """Make a certificate authority, which signs for itself."""
    key = ec.generate_private_key(ec.SECP256R1())
    name = _name(f"zenoh-vision {namespace}"[:LONGEST_NAME])
    public = key.public_key()
    usage = x509.KeyUsage(
        digital_signature=False,
        content_commitment=False,
        key_encipherment=False,
        data_encipherment=False,
        key_agreement=False,
        key_cert_sign=True,
        crl_sign=True,
        encipher_only=False,
        decipher_only=False,
    )
    builder = (
        _builder(name, name, AUTHORITY_DAYS)
        .public_key(public)
        .add_extension(x509.BasicConstraints(ca=True, path_length=0), critical=True)
        .add_extension(usage, critical=True)
        .add_extension(x509.SubjectKeyIdentifier.from_public_key(public), critical=False)
    )
    return _signed(builder, key, key)


def issue(authority: Issued, common_name: str, hosts: Iterable[str], days: int) -> Issued:
    """Issue a certificate; with hosts it also serves as that of a router there.

    It ends with the authority at the latest. Access rules go by the common name.

    Raises:
        ConfigurationError: The authority has ended.
    """
    if authority.ends_s <= time.time():
        raise ConfigurationError(
            f"the authority ended {shown_time(authority.ends_s)}, and this machine's clock says "
            f"{shown_time(time.time())}: make another folder with zv security init and copy all "
            "files again, unless the clock is wrong"
        )
    signer = serialization.load_pem_private_key(authority.key, None)
    assert isinstance(signer, ec.EllipticCurvePrivateKey)
    issuer = x509.load_pem_x509_certificate(authority.certificate).subject
    key = ec.generate_private_key(ec.SECP256R1())
    public = key.public_key()
    alternatives = [_alternative(host) for host in hosts]
    purposes = [ExtendedKeyUsageOID.CLIENT_AUTH]
    if alternatives:
        purposes.append(ExtendedKeyUsageOID.SERVER_AUTH)
    # A certificate without any alternative name is refused by some programs.
    alternatives = alternatives or [x509.DNSName(common_name.replace("_", "-"))]
    signer_id = x509.AuthorityKeyIdentifier.from_issuer_public_key(signer.public_key())
    builder = (
        _builder(_name(common_name), issuer, days, authority.ends_s)
        .public_key(public)
        .add_extension(x509.BasicConstraints(ca=False, path_length=None), critical=True)
        .add_extension(x509.ExtendedKeyUsage(purposes), critical=False)
        .add_extension(x509.SubjectAlternativeName(alternatives), critical=False)
        .add_extension(signer_id, critical=False)
    )
    return _signed(builder, key, signer)


def belong_together(issued: Issued) -> bool:
    """Tell whether a key is that of its certificate.

    Raises:
        ValueError: One of them cannot be read.
    """
    key = serialization.load_pem_private_key(issued.key, None)
    certificate = x509.load_pem_x509_certificate(issued.certificate)
    return key.public_key() == certificate.public_key()


def _alternative(host: str) -> x509.GeneralName:
    try:
        return x509.IPAddress(ipaddress.ip_address(host))
    except ValueError:
        return x509.DNSName(host)


def _name(common_name: str) -> x509.Name:
    return x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, common_name)])


def _builder(
    subject: x509.Name, issuer: x509.Name, days: int, latest_s: float = math.inf
) -> x509.CertificateBuilder:
    begin = datetime.now(UTC) - BACKDATED
    end = begin + timedelta(days=days)
    if end.timestamp() > latest_s:  # browsers and the viewer end with the authority, routers do not
        end = datetime.fromtimestamp(latest_s, UTC)
    return (
        x509.CertificateBuilder()
        .subject_name(subject)
        .issuer_name(issuer)
        .serial_number(x509.random_serial_number())
        .not_valid_before(begin)
        .not_valid_after(end)
    )


def _signed(
    builder: x509.CertificateBuilder,
    key: ec.EllipticCurvePrivateKey,
    signer: ec.EllipticCurvePrivateKey,
) -> Issued:
    certificate = builder.sign(signer, hashes.SHA256())
    pem = serialization.Encoding.PEM
    form, plain = serialization.PrivateFormat.PKCS8, serialization.NoEncryption()
    return Issued(certificate.public_bytes(pem), key.private_bytes(pem, form, plain))
