"""A browser of a few lines: requests, streams of pictures, the page's WebSocket."""

from __future__ import annotations

import asyncio
import http.client
import json
import socket
import struct
from collections.abc import AsyncIterator, Iterator
from contextlib import asynccontextmanager, closing, contextmanager
from dataclasses import dataclass
from typing import Any
from urllib.parse import urljoin, urlsplit

import aiohttp
import psutil

from tests.support.processes import Program
from tests.support.waiting import DEADLINE_S

IMAGE = "vision/front/image/compressed"


@dataclass(frozen=True)
class Answer:
    """What came back."""

    status: int
    headers: dict[str, str]
    body: bytes

    @property
    def text(self) -> str:
        return self.body.decode()


@dataclass(frozen=True)
class Part:
    """One picture of a multipart stream."""

    headers: dict[str, str]
    body: bytes

    @property
    def seq(self) -> int:
        return int(self.headers["x-seq"])


def get(port: int, path: str, method: str = "GET", **headers: str) -> Answer:
    """Ask a port of this machine for a path; ``headers`` are named with ``_`` for ``-``."""
    connection = http.client.HTTPConnection("127.0.0.1", port, timeout=DEADLINE_S)
    try:
        named = {name.replace("_", "-"): value for name, value in headers.items()}
        connection.request(method, path, headers=named)
        answer = connection.getresponse()
        found = {name.lower(): value for name, value in answer.getheaders()}
        return Answer(answer.status, found, answer.read())
    finally:
        connection.close()


@dataclass
class Viewer:
    """A running ``zv view``."""

    program: Program

    @property
    def url(self) -> str:
        """The address that it prints."""
        return self.program.lines(r"http://\S+/\S*")[0][0]

    @property
    def port(self) -> int:
        port = urlsplit(self.url).port
        assert port is not None
        return port

    def get(self, path: str, method: str = "GET", **headers: str) -> Answer:
        """Ask for a path as it stands; ``headers`` are named with ``_`` for ``-``."""
        return get(self.port, path, method, **headers)

    def open(self, path: str, **headers: str) -> Answer:
        """Ask for a page as a browser does, which follows a redirect with the cookie it got."""
        answer = self.get(path, **headers)
        if answer.status != 303:
            return answer
        cookie = answer.headers["set-cookie"].partition(";")[0]
        place = urljoin(path, answer.headers["location"])
        return self.get(place, **headers, Cookie=cookie)

    @contextmanager
    def stream(self, query: str) -> Iterator[Iterator[Part]]:
        """Begin a stream; what is entered yields its pictures."""
        connection = http.client.HTTPConnection("127.0.0.1", self.port, timeout=DEADLINE_S)
        connection.request("GET", f"/stream?{query}")
        with closing(connection), connection.getresponse() as answer:
            assert answer.status == 200, (answer.status, answer.read())
            yield parts(answer)

    def deaf(self) -> socket.socket:
        """Connect with a small buffer, which is soon full unless somebody reads from it."""
        connected = socket.create_connection(("127.0.0.1", self.port))
        connected.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1 << 16)
        return connected

    @asynccontextmanager
    async def page(self, **options: Any) -> AsyncIterator[Page]:
        """Open the page's WebSocket."""
        address = f"http://127.0.0.1:{self.port}/live"
        async with (
            aiohttp.ClientSession() as session,
            session.ws_connect(address, **options) as socket,
        ):
            yield Page(socket)


async def until_closed(port: int) -> None:
    """Wait until this process has no connection to a port: aiohttp leaves TLS' end to the loop."""
    while any(
        each.raddr and each.raddr.port == port for each in psutil.Process().net_connections("tcp")
    ):
        await asyncio.sleep(0.01)


def parts(answer: http.client.HTTPResponse) -> Iterator[Part]:
    """Yield the pictures of a multipart answer."""
    boundary = answer.headers["Content-Type"].partition("boundary=")[2].encode()
    while line := answer.readline():
        if line.strip() != b"--" + boundary:
            assert not line.strip(), line
            continue
        headers: dict[str, str] = {}
        while text := answer.readline().strip().decode():
            name, _, value = text.partition(":")
            headers[name.lower()] = value.strip()
        yield Part(headers, answer.read(int(headers["content-length"])))


class Page:
    """The other end of ``/live``."""

    def __init__(self, socket: aiohttp.ClientWebSocketResponse) -> None:
        self.socket = socket
        self.texts: list[dict[str, Any]] = []
        self._begun: tuple[dict[str, Any], list[bytes]] | None = None  # a picture in parts

    async def ask(self, op: str, **fields: Any) -> None:
        await self.socket.send_str(json.dumps({"op": op, **fields}))

    async def text(self, op: str, **wanted: Any) -> dict[str, Any]:
        """Return the next text of this kind and with these fields."""
        while True:
            found = await self.next()
            if isinstance(found, dict) and found.items() >= {"op": op, **wanted}.items():
                return found

    async def until(self, op: str) -> dict[str, Any]:
        """Return the next text of this kind; pictures before it are taken."""
        while True:
            found = await self.next()
            if isinstance(found, tuple):
                await self.ask("shown", key=found[0]["key"])
            elif found["op"] == op:
                return found

    async def picture(self, shown: bool = True) -> tuple[dict[str, Any], bytes]:
        """Return the next picture, and say that it was shown."""
        while isinstance(found := await self.next(), dict):
            pass
        if shown:
            await self.ask("shown", key=found[0]["key"])
        return found

    async def next(self) -> dict[str, Any] | tuple[dict[str, Any], bytes]:
        message = await self.socket.receive(DEADLINE_S)
        if message.type == aiohttp.WSMsgType.TEXT:
            text: dict[str, Any] = json.loads(message.data)
            self.texts.append(text)
            return text
        assert message.type == aiohttp.WSMsgType.BINARY, message
        if self._begun is None:
            (length,) = struct.unpack("<I", message.data[:4])
            self._begun = json.loads(message.data[4 : 4 + length]), [message.data[4 + length :]]
        else:
            self._begun[1].append(message.data)
        head, parts = self._begun
        if sum(map(len, parts)) < head["bytes"]:
            return await self.next()
        self._begun = None
        return head, b"".join(parts)

    async def streams(self, *keys: str) -> list[dict[str, Any]]:
        """Return the list of streams as soon as all of these are in it and live."""
        while True:
            streams = (await self.text("streams"))["streams"]
            if set(keys) <= {each["key"] for each in streams if each["live"]}:
                return list(streams)
