"""A TCP proxy on a free port of this machine that passes on so many bytes a second, and no more."""

from __future__ import annotations

import asyncio
import socket
import threading
from contextlib import suppress
from typing import Self

ONE_MBIT = 125_000
"""Bytes a second."""

BUFFER_BYTES = 16 << 10
STEP_S = 0.02


class SlowLink:
    """Forwards connections to a port; all share the rate towards the client.

    Attributes:
        port: Of the proxy.
        carried: Bytes that were passed on to clients.
        requests: First line of each connection's first request.
    """

    def __init__(self, to_port: int, bytes_per_s: int) -> None:
        self.port = 0
        self.carried = 0
        self.requests: list[str] = []
        self._to_port = to_port
        self._bytes_per_s = bytes_per_s
        self._begun = threading.Event()
        self._thread = threading.Thread(target=lambda: asyncio.run(self._serve()), daemon=True)

    def __enter__(self) -> Self:
        self._thread.start()
        assert self._begun.wait(10)
        return self

    def __exit__(self, *error: object) -> None:
        """Cut all connections."""
        self._loop.call_soon_threadsafe(self._end.set)
        self._thread.join(10)

    async def _serve(self) -> None:
        self._loop = asyncio.get_running_loop()
        self._end = asyncio.Event()
        self._turn = asyncio.Lock()
        with socket.socket() as listening:
            # Small buffers, since what waits in them is old when it arrives.
            listening.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, BUFFER_BYTES)
            listening.bind(("127.0.0.1", 0))
            self.port = listening.getsockname()[1]
            async with await asyncio.start_server(self._pass_on, sock=listening):
                self._begun.set()
                await self._end.wait()

    async def _pass_on(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        upstream = socket.socket()
        upstream.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, BUFFER_BYTES)
        upstream.setblocking(False)
        await asyncio.get_running_loop().sock_connect(upstream, ("127.0.0.1", self._to_port))
        back, there = await asyncio.open_connection(sock=upstream, limit=BUFFER_BYTES)
        try:
            with suppress(OSError, asyncio.CancelledError):
                await asyncio.gather(self._ask(reader, there), self._answer(back, writer))
        finally:
            for end in (there, writer):
                end.transport.abort()

    async def _ask(self, reader: asyncio.StreamReader, there: asyncio.StreamWriter) -> None:
        first = True
        while data := await reader.read(BUFFER_BYTES):
            if first:
                self.requests.append(data.split(b"\r\n", 1)[0].decode("latin-1"))
            first = False
            there.write(data)
            await there.drain()
        there.write_eof()

    async def _answer(self, back: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        most = int(self._bytes_per_s * STEP_S)
        while data := await back.read(most):
            async with self._turn:  # the link carries one after the other
                await asyncio.sleep(len(data) / self._bytes_per_s)
            writer.write(data)
            await writer.drain()
            self.carried += len(data)
        writer.write_eof()
