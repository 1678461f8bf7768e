"""The viewer's own TLS: with certificates of ``zv security web``, and with wrong ones."""

from __future__ import annotations

import base64
import http.client
import json
import re
import socket
import ssl
import subprocess
from contextlib import closing
from itertools import pairwise
from pathlib import Path
from urllib.parse import urlsplit

import aiohttp
import numpy as np
import pytest

from tests.integration.conftest import Service
from tests.support.fork_server import ZV
from tests.support.processes import START_S, Program, need
from tests.support.publishing import PlainCamera
from tests.support.secured import Secured, embedded, quietly, secured
from tests.support.typist import type_zv
from tests.support.viewer.client import Page, parts, until_closed
from tests.support.waiting import wait_until
from zenoh_vision.image import codecs
from zenoh_vision.security.credentials import CERTIFICATE, KEY
from zv.tools.security.options import WebOptions
from zv.tools.security.web import web

TOKEN = "0123456789abcdef-token"
HOST = "127.0.0.1"


@pytest.fixture(scope="module")
def system(tmp_path_factory: pytest.TempPathFactory) -> Secured:
    """A system with an operator, a guest and another operator, and a certificate for the viewer."""
    made = secured(tmp_path_factory.mktemp("web"), operator=("operator", "ada"))
    quietly(web, WebOptions(dir=str(made.folder)))
    return made


def flags(system: Secured) -> list[object]:
    own = system.folder / "web.pem"
    return ["--port", 0, "--tls-certificate", own, "--tls-clients", system.folder / "ca.pem"]


@pytest.fixture(scope="module")
def viewer(system: Secured, standing_service: Service) -> Program:
    return standing_service("view", *flags(system))


def port_of(viewer: Program) -> int:
    found = urlsplit(viewer.lines(r"https://127.0.0.1:\d+/\S*")[0][0]).port
    assert found is not None
    return found


def context(system: Secured, name: str = "") -> ssl.SSLContext:
    """Return the TLS of a browser that trusts the authority, with somebody's certificate."""
    made = ssl.create_default_context(cafile=system.folder / "ca.pem")
    if name:
        file = system.folder / f"{name}.browser.pem"
        if not file.exists():
            done = ["-in", system.folder / f"{name}.p12", "-nodes", "-passin", "pass:"]
            run("pkcs12", *done, "-out", file)
        made.load_cert_chain(file)
    return made


def run(*words: object) -> str:
    command = [need("openssl", "openssl"), *map(str, words)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=20, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout


def get(
    viewer: Program, tls: ssl.SSLContext, path: str = "/", **headers: str
) -> tuple[int, dict[str, str], str]:
    connection = http.client.HTTPSConnection(HOST, port_of(viewer), timeout=20, context=tls)
    with closing(connection):
        connection.request("GET", path, headers=headers)
        answer = connection.getresponse()
        return answer.status, dict(answer.getheaders()), answer.read().decode(errors="replace")


async def scope(viewer: Program, tls: ssl.SSLContext) -> str:
    """Return what a page is told that it may."""
    where = f"https://{HOST}:{port_of(viewer)}/live"
    async with aiohttp.ClientSession() as browser, browser.ws_connect(where, ssl=tls) as live:
        hello = await Page(live).text("hello")
    await until_closed(port_of(viewer))
    return str(hello["scope"])


async def test_a_certificate_decides_what_a_browser_may(viewer: Program, system: Secured):
    assert await scope(viewer, context(system, "operator")) == "control"
    assert await scope(viewer, context(system, "guest")) == "view"


def test_a_browser_that_stops_reading_sees_the_newest_pictures_when_it_goes_on(
    system: Secured, service: Service, client
):
    viewer = service("view", *flags(system))
    noise = np.random.default_rng(1).integers(0, 255, (480, 640, 3), np.uint8)
    camera = PlainCamera(client, pictures=(codecs.encode_jpeg(noise, "bgr8", 90),))  # 300 kB
    tls = context(system, "operator")
    with camera.at(60), closing(socket.create_connection((HOST, port_of(viewer)))) as plain:
        plain.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1 << 16)
        path = "/stream?topic=/front/image/compressed"
        wait_until(lambda: get(viewer, tls, path.replace("stream", "snapshot"))[0] == 200)
        with tls.wrap_socket(plain, server_hostname=HOST) as browser:
            browser.sendall(f"GET {path} HTTP/1.1\r\nHost: localhost\r\n\r\n".encode())
            begun = camera.seq
            wait_until(lambda: camera.seq > begun + 120)
            answer = http.client.HTTPResponse(browser)
            answer.begin()
            pictures = parts(answer)
            seen = [next(pictures).seq for _ in range(12)]
    assert seen == sorted(set(seen))
    assert max(b - a for a, b in pairwise(seen)) > 60, "nothing of 120 pictures was skipped"


@pytest.mark.parametrize(
    ("name", "said"),
    [("", "the browser has none"), ("ada", "the name in it has no rights here")],
)
def test_no_other_browser_gets_anything(viewer: Program, system: Secured, name: str, said: str):
    for path in ("/", "/page/js/main.js", "/stream?topic=/front/image/compressed"):
        status, _, text = get(viewer, context(system, name), path)
        assert status == 403
        assert said in text
    assert get(viewer, context(system), "/healthz")[2] == "ok\n"


def test_a_certificate_of_a_node_is_none_of_a_person(viewer: Program, system: Secured):
    tls = system.content("camera_front")["transport"]["link"]["tls"]
    file = system.folder / "camera.pem"
    file.write_bytes(b"".join(base64.b64decode(tls[part]) for part in (CERTIFICATE, KEY)))
    made = context(system)
    made.load_cert_chain(file)
    assert get(viewer, made)[0] == 403


def test_a_certificate_of_another_authority_is_refused_by_tls(
    viewer: Program, system: Secured, tmp_path: Path
):
    other = secured(tmp_path)
    quietly(web, WebOptions(dir=str(other.folder)))
    made = context(other, "operator")
    made.load_verify_locations(system.folder / "ca.pem")
    # An alert, or the end that comes with it.
    with pytest.raises((ssl.SSLError, ConnectionError)):
        get(viewer, made)


def test_curl_uses_the_file_for_browsers_as_it_is(viewer: Program, system: Secured):
    url = f"https://localhost:{port_of(viewer)}/streams"
    own = ["--cert-type", "P12", "--cert", f"{system.folder / 'operator.p12'}:"]
    command = [need("curl", "curl"), "-sS", "--cacert", str(system.folder / "ca.pem"), *own, url]
    done = subprocess.run(command, capture_output=True, text=True, timeout=20, check=False)
    assert "<html" in done.stdout, done.stderr


async def test_a_token_is_as_good_as_a_certificate_where_both_are_set(
    system: Secured, service: Service
):
    with_token = service("view", *flags(system), "--token", TOKEN, "--tls-operators", "ada")
    status, headers, _ = get(with_token, context(system), f"/?token={TOKEN}")
    assert status == 303
    assert "; Secure" in headers["Set-Cookie"]
    assert get(with_token, context(system), Authorization=f"Bearer {TOKEN}")[0] == 200
    assert get(with_token, context(system))[0] == 401
    assert get(with_token, context(system, "operator"))[0] == 401  # who is no operator here
    assert await scope(with_token, context(system, "ada")) == "control"


def served(viewer: Program, system: Secured) -> str:
    """Return the serial number of the certificate that the viewer shows."""
    shown = run(
        "s_client", "-connect", f"{HOST}:{port_of(viewer)}", "-CAfile", system.folder / "ca.pem"
    )
    file = system.folder / "shown.pem"
    file.write_text(shown)
    return run("x509", "-in", file, "-noout", "-serial")


def test_files_that_are_replaced_are_taken_and_wrong_ones_are_told(
    tmp_path: Path, service: Service
):
    own_system = secured(tmp_path)
    quietly(web, WebOptions(dir=str(own_system.folder)))
    viewer = service("view", *flags(own_system))
    first = served(viewer, own_system)
    quietly(web, WebOptions(dir=str(own_system.folder)))
    wait_until(lambda: served(viewer, own_system) != first)
    second = served(viewer, own_system)
    own = own_system.folder / "web.pem"
    own.write_text(own.read_text().partition("-----BEGIN PRIVATE KEY")[0])
    wait_until(lambda: "the former certificate is in use" in viewer.complaints)
    assert "no private key in it" in viewer.complaints
    assert served(viewer, own_system) == second


def test_a_wrong_file_is_one_sentence_and_status_2(system: Secured, tmp_path: Path):
    words = ["view", "--tls-certificate", system.folder / "ca.pem", "--port", 0]
    done = type_zv(words)
    assert done.returncode == 2
    assert len(done.stderr.splitlines()) == 1
    assert f"tls_key {system.folder / 'ca.pem'}: " in done.stderr
    done = type_zv(["view", "--tls-key", tmp_path / "key.pem"])
    assert (done.returncode, "tls_key needs tls_certificate" in done.stderr) == (2, True)


async def test_the_command_that_is_printed_starts_a_viewer_for_these_people(tmp_path: Path):
    system = secured(tmp_path, operator=("ada",))
    words = ["security", "web", "--dir", system.folder, "--host", "cam.example"]
    printed = re.findall(r"^  zv (view .*)$", type_zv(words).stdout, re.MULTILINE)
    here = ["--host", HOST, "--port", "0"]  # beside other tests, and on this machine only
    with (
        embedded(system, tmp_path),
        Program([*printed[0].split(), *here], tmp_path, "viewer", forked=ZV) as viewer,
    ):
        wait_until(lambda: "connected to the router" in viewer.complaints, START_S)
        assert await scope(viewer, context(system, "ada")) == "control"
        assert await scope(viewer, context(system, "guest")) == "view"
        assert get(viewer, context(system, "guest"), Host="cam.example")[0] == 200
        status, _, text = get(viewer, context(system, "guest"), Host="other.example")
        assert (status, text.endswith("--allow-host other.example allows it\n")) == (403, True)


def test_the_command_that_is_printed_allows_the_names_of_the_certificate(tmp_path: Path):
    folder = tmp_path / "security"
    hosts = ["--host", "cam.example", "--host", "fd00::5"]
    assert type_zv(["security", "init", folder, *hosts]).returncode == 0
    said = type_zv(["security", "web", "--dir", folder]).stdout  # those of the router
    assert ", for cam.example, fd00::5, localhost, 127.0.0.1, ::1, router\n" in said
    assert " --allow-host cam.example --credentials " in said
    addresses = ["--host", "fd00::5", "--host", "192.168.0.2"]  # a browser may always use them
    said = type_zv(["security", "web", "--dir", folder, *addresses]).stdout
    assert "zv view --host 0.0.0.0 --credentials " in said


def test_the_command_that_is_printed_admits_all_but_the_revoked(tmp_path: Path):
    system = secured(tmp_path, operator=("operator", "ada", "bob"))
    for who in ("operator", "guest"):
        revoked = type_zv(["security", "revoke", who, "--dir", system.folder])
        assert revoked.returncode == 0, revoked.stderr
    done = type_zv(["security", "web", "bob", "--dir", system.folder])
    assert "/ca.pem --tls-operators ada,bob --tls-guests ''\n" in done.stdout


def test_the_names_of_the_certificate_are_said(system: Secured):
    done = type_zv(["security", "web", "--dir", system.folder, "--host", "cam.example", "--json"])
    written = json.loads(done.stdout)
    assert written["names"] == "ada,guest,operator"
    names = run("x509", "-in", system.folder / "web.pem", "-noout", "-ext", "subjectAltName")
    assert "DNS:cam.example" in names
    assert "IP Address:127.0.0.1" in names
    done = type_zv(["security", "web", "camera_front", "--dir", system.folder])
    assert done.returncode == 2
    assert "camera_front is no person; allowed: ada, guest, operator" in done.stderr
