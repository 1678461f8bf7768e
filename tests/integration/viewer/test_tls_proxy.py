"""The viewer behind Caddy and nginx, each with the configuration that docs/deploy.md names."""

from __future__ import annotations

import re
import socket
import subprocess
from collections.abc import AsyncIterator, Iterator
from contextlib import asynccontextmanager, closing, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import aiohttp
import numpy as np
import pytest
from aiohttp.abc import AbstractResolver, ResolveResult

from tests.support.processes import ROOT, STOP_S, need
from tests.support.publishing import PlainCamera
from tests.support.routing import free_port
from tests.support.viewer.client import IMAGE, Page, Viewer, until_closed
from tests.support.waiting import wait_until
from zenoh_vision.image import codecs

NAME = "cam.example"
TOKEN = "0123456789abcdef-token"


@dataclass(frozen=True)
class Proxied:
    """A viewer, and the port of the proxy in front of it."""

    viewer: Viewer
    port: int

    @property
    def url(self) -> str:
        return f"https://{NAME}:{self.port}"

    @asynccontextmanager
    async def browser(self) -> AsyncIterator[aiohttp.ClientSession]:
        """Open a client that has its session cookie, and trusts the certificate."""
        connector = aiohttp.TCPConnector(ssl=False, resolver=ThisMachine())
        jar = aiohttp.CookieJar()
        async with aiohttp.ClientSession(self.url, connector=connector, cookie_jar=jar) as session:
            async with session.get(f"/?token={TOKEN}", allow_redirects=False) as answer:
                assert answer.status == 303
                assert "; Secure" in answer.headers["Set-Cookie"]
            yield session
        await until_closed(self.port)


class ThisMachine(AbstractResolver):
    """Resolves every name to this machine."""

    async def resolve(
        self, host: str, port: int = 0, family: socket.AddressFamily = socket.AF_INET
    ) -> list[ResolveResult]:
        return [
            ResolveResult(
                hostname=host, host="127.0.0.1", port=port, family=socket.AF_INET, proto=0, flags=0
            )
        ]

    async def close(self) -> None:
        pass


@pytest.fixture(scope="module")
def certificate(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """A certificate of the name, and its key."""
    folder = tmp_path_factory.mktemp("certificate")
    found = folder / "cert.pem", folder / "key.pem"
    command = [need("openssl", "openssl"), "req", "-x509", "-newkey", "rsa:2048", "-nodes"]
    command += ["-subj", f"/CN={NAME}", "-out", str(found[0]), "-keyout", str(found[1])]
    subprocess.run(command, check=True, capture_output=True)
    return found


@pytest.fixture(params=["caddy", "nginx"])
def proxied(
    request: pytest.FixtureRequest, service: Any, certificate: tuple[Path, Path], tmp_path: Path
) -> Iterator[Proxied]:
    """A viewer behind a proxy, configured as in examples/tls but for ports and certificate."""
    # A single picture that a busy machine keeps waiting is not to be dropped for its age.
    flags = ("--allow-host", NAME, "--token", TOKEN, "--max-age", "60s")
    viewer = Viewer(service("view", "--port", 0, *flags))
    port = free_port()
    start = {"caddy": caddy, "nginx": nginx}[request.param]
    with start(viewer.port, port, certificate, tmp_path):
        wait_until(lambda: accepts(port))
        yield Proxied(viewer, port)


@contextmanager
def caddy(upstream: int, port: int, certificate: tuple[Path, Path], folder: Path) -> Iterator[None]:
    """Run Caddy with examples/tls/Caddyfile."""
    text = (ROOT / "examples/tls/Caddyfile").read_text()
    text = replaced(
        text, f"{NAME} {{", f"{NAME}:{port} {{\n\ttls {' '.join(map(str, certificate))}"
    )
    text = replaced(text, "127.0.0.1:8080", f"127.0.0.1:{upstream}")
    file = folder / "Caddyfile"
    file.write_text("{\n\tadmin off\n\tauto_https off\n}\n" + text)
    program = need("caddy", "caddy")
    with running([program, "run", "--adapter", "caddyfile", "--config", str(file)], folder):
        yield


@contextmanager
def nginx(upstream: int, port: int, certificate: tuple[Path, Path], folder: Path) -> Iterator[None]:
    """Run nginx with examples/tls/nginx.conf as a site."""
    text = (ROOT / "examples/tls/nginx.conf").read_text()
    text = replaced(text, "listen 443 ssl", f"listen 127.0.0.1:{port} ssl")
    text = replaced(text, "127.0.0.1:8080", f"127.0.0.1:{upstream}")
    for name, file in zip(("fullchain", "privkey"), certificate, strict=True):
        text = replaced(text, f"/etc/letsencrypt/live/{NAME}/{name}.pem", str(file))
    paths = ("client_body", "proxy", "fastcgi", "uwsgi", "scgi")
    places = "".join(f"{path}_temp_path {folder}/{path};" for path in paths)
    main = folder / "nginx.conf"
    main.write_text(
        f"pid {folder}/nginx.pid; error_log stderr; events {{}}"
        f"http {{ access_log off; {places}\n{text}}}"
    )
    program = need("nginx", "nginx-light")
    with running([program, "-p", str(folder), "-c", str(main), "-g", "daemon off;"], folder):
        yield


def replaced(text: str, old: str, new: str) -> str:
    """Replace what must be there."""
    assert old in text
    return text.replace(old, new)


@contextmanager
def running(command: list[str], folder: Path) -> Iterator[None]:
    """Run a program in a folder while the context lasts."""
    with (folder / "proxy.err").open("wb") as err:
        program = subprocess.Popen(
            command, cwd=folder, stdout=err, stderr=err, env={"HOME": str(folder)}
        )
    try:
        yield
    finally:
        program.terminate()
        program.wait(STOP_S)


def accepts(port: int) -> bool:
    """Tell whether something listens."""
    with closing(socket.socket()) as probe:
        return probe.connect_ex(("127.0.0.1", port)) == 0


async def test_the_page_has_a_secure_session_and_gets_each_picture_before_there_is_another(
    proxied: Proxied, client
):
    # A picture smaller than the 4 kB of a proxy's buffer: one that fills buffers holds it back.
    small = codecs.encode_jpeg(np.zeros((48, 64, 3), np.uint8), "bgr8", 80)
    camera = PlainCamera(client, pictures=(small,))

    async def picture(stream: aiohttp.ClientResponse, seq: int) -> None:
        """Read to the end of the first picture of this number or a later one."""
        assert stream.status == 200
        received, ended = b"", 0
        while not any(
            int(number) >= seq for number in re.findall(rb"X-Seq: (\d+)\r\n", received[:ended])
        ):
            received += await stream.content.readany()
            ended = received.rfind(b"\xff\xd9") + 1

    async with proxied.browser() as browser:
        async with browser.get("/") as index:
            assert index.status == 200
            assert "<html" in await index.text()
        async with browser.ws_connect("/live", origin=proxied.url) as socket:
            page = Page(socket)
            await page.text("hello")
            with camera.at(10):
                await page.ask("watch", key=IMAGE)
                head, payload = await page.picture()
                # The viewer answers 404 for a camera that sends nothing.
                stream = await browser.get("/stream?topic=/front/image/compressed")
                await picture(stream, 0)
        assert (head["key"], payload) == (IMAGE, small)
        with closing(stream):
            for _ in range(3):
                await picture(stream, camera.send())
