"""Which files the viewer's TLS takes, and whose certificates have rights."""

from __future__ import annotations

import subprocess
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest

from zenoh_vision.errors import ConfigurationError
from zv.tools.security.authority import Issued, issue, new_authority
from zv.viewer.credentials import Scope
from zv.viewer.http.tls import Holders, ServerTls
from zv.viewer.settings import ViewerSettings

DAY_S = 24 * 3600


@pytest.fixture(scope="module")
def authority() -> Issued:
    return new_authority("vision")


@pytest.fixture
def files(authority: Issued, tmp_path: Path) -> dict[str, Path]:
    own, other = (issue(authority, "viewer-web", ("localhost",), 100) for _ in range(2))
    contents = {
        "certificate": own.certificate,
        "key": own.key,
        "other_key": other.key,
        "both": own.certificate + own.key,
        "authority": authority.certificate,
        "text": b"no PEM\n",
        "empty": b"",
    }
    found = {}
    for name, content in contents.items():
        found[name] = tmp_path / f"{name}.pem"
        found[name].write_bytes(content)
        found[name].chmod(0o600)
    locked = tmp_path / "locked.pem"
    command = ["openssl", "pkey", "-in", found["key"], "-aes256", "-passout", "pass:abcd"]
    subprocess.run([*command, "-out", locked], check=True)
    opened = tmp_path / "opened.pem"
    opened.write_bytes(own.key)
    opened.chmod(0o644)
    return found | {"missing": tmp_path / "missing.pem", "locked": locked, "opened": opened}


def tls(files: Mapping[str, Path], **names: str) -> ServerTls:
    given: Any = {f"tls_{kind}": str(files[name]) for kind, name in names.items()}
    return ServerTls(ViewerSettings(**given))


@pytest.mark.parametrize(
    "names",
    [
        {"certificate": "both"},
        {"certificate": "certificate", "key": "key"},
        {"certificate": "both", "clients": "authority"},
    ],
)
def test_files_that_belong_together_are_taken(files, names):
    found = tls(files, **names)
    assert found.warning() == ""
    assert (found.holders is not None) == ("clients" in names)


@pytest.mark.parametrize(
    ("names", "said"),
    [
        ({"certificate": "missing"}, "tls_certificate {missing}: No such file"),
        ({"certificate": "text", "key": "key"}, "tls_certificate {text}: no certificate in it"),
        ({"certificate": "key", "key": "key"}, "tls_certificate {key}: no certificate in it"),
        ({"certificate": "certificate"}, "tls_key {certificate}: "),
        ({"certificate": "certificate", "key": "missing"}, "tls_key {missing}: No such file"),
        ({"certificate": "certificate", "key": "empty"}, "tls_key {empty}: no private key in it"),
        ({"certificate": "certificate", "key": "other_key"}, "tls_key {other_key}: the key is not"),
        ({"certificate": "certificate", "key": "locked"}, "tls_key {locked}: the key has a passw"),
        ({"certificate": "certificate", "key": "opened"}, "tls_key {opened}: everybody on this"),
        ({"certificate": "both", "clients": "missing"}, "tls_clients {missing}: No such file"),
        ({"certificate": "both", "clients": "text"}, "tls_clients {text}: no certificate in it"),
    ],
)
def test_a_file_that_cannot_be_used_is_one_sentence_that_names_it(files, names, said):
    with pytest.raises(ConfigurationError) as raised:
        tls(files, **names)
    assert str(raised.value).startswith(said.format(**files))
    assert "\n" not in str(raised.value)


def test_the_end_of_a_certificate_is_warned_about(files, authority):
    found = tls(files, certificate="both")
    now_s = time.time()
    assert found.warning(now_s + 89 * DAY_S) == ""
    assert "both.pem: ends 2" in found.warning(now_s + 91 * DAY_S)
    assert "both.pem: ended 2" in found.warning(now_s + 101 * DAY_S)


def test_a_clock_before_the_begin_of_a_certificate_is_warned_about(files):
    said = tls(files, certificate="both").warning(time.time() - DAY_S)
    assert "both.pem: valid from 2" in said
    assert said.endswith(" only, but this machine's clock is before that; set the clock")


def certificate(name: str) -> dict[str, Any]:
    subject = ((("organizationName", "operator"),), (("commonName", name),))
    return {"subject": subject, "notAfter": "Jan  1 00:00:00 2036 GMT"}


@pytest.mark.parametrize(
    ("operators", "guests", "name", "scope"),
    [
        ("operator", "guest", "operator", Scope.CONTROL),
        ("operator", "guest", "guest", Scope.VIEW),
        ("operator", "guest", "camera_front", None),
        ("operator", "guest", "organizationName", None),
        ("operator", "guest", "", None),
        ("ada,max", "*", "max", Scope.CONTROL),
        ("ada,max", "*", "eve", Scope.VIEW),
        ("*", "", "eve", Scope.CONTROL),
        ("", "", "eve", None),
    ],
)
def test_a_name_decides_and_nothing_else_of_a_certificate(operators, guests, name, scope):
    holders = Holders(frozenset(operators.split(",")), frozenset(guests.split(",")))
    found = holders.principal(certificate(name))
    assert (found and found.scope) == scope
    if found:
        assert found.forbidden(2_082_758_400.0 + 1)  # a page that is open ends with it


def test_a_certificate_that_ends_while_its_connection_is_kept_has_no_rights_any_more(monkeypatch):
    holders = Holders(frozenset({"operator"}), frozenset())
    ends_s = 2_082_758_400.0  # as in ``certificate``
    monkeypatch.setattr(time, "time", lambda: ends_s - 1)
    assert holders.principal(certificate("operator"))
    monkeypatch.setattr(time, "time", lambda: ends_s)
    assert holders.principal(certificate("operator")) is None
