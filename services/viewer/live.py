"""``/live``: one page's WebSocket. The protocol is docs/viewer.md's."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Hashable

from aiohttp import WSCloseCode, WSMsgType, web

from common.errors import ParameterRefused, VisionError
from common.parameter_text import toml_file
from services.viewer import wire
from services.viewer.hub import Hub
from services.viewer.messages import MessageFeed
from services.viewer.outbox import Outbox
from services.viewer.renditions import Feed
from services.viewer.requests import (
    MAX_RATE_HZ,
    Dump,
    Malformed,
    Quota,
    Set,
    Shown,
    Unwatch,
    Watch,
    request_of,
)
from services.viewer.topics import is_stream, kind_of
from services.viewer.watching import Unanswered, Watcher

MAX_WATCHES = 32
AHEAD = 2
"""Pictures of a stream that may be on their way to a page before it says that it shows one."""

HEARTBEAT_S = 15.0
STALLED_S = 20.0
ENDED_POLL_S = 0.2
MESSAGES_AT_ONCE = 16


class Watching:
    """One stream of pictures that a page watches."""

    def __init__(self, feed: Feed) -> None:
        self.feed = feed
        self.credit = AHEAD
        self.ended = False


class Page:
    """One connection.

    Args:
        socket: Prepared.
        request: That it came with.
        hub: The streams.
        watcher: The system.
    """

    def __init__(
        self, socket: web.WebSocketResponse, request: web.Request, hub: Hub, watcher: Watcher
    ) -> None:
        self._socket = socket
        self._request = request
        self._hub = hub
        self._watcher = watcher
        self._wake = asyncio.Event()
        self.outbox = Outbox(self._wake.set)
        self._pictures: dict[str, Watching] = {}
        self._messages: dict[str, MessageFeed] = {}
        self._asked: set[asyncio.Task[None]] = set()
        self._quota = Quota()

    def tell(self, text: str, replaces: Hashable | None = None) -> None:
        """Leave a text for the page; one that does not read for too long is left."""
        self.outbox.put(text, replaces)
        if self.outbox.full and self._request.transport is not None:
            self._request.transport.abort()

    async def serve(self) -> None:
        """Serve the page until it goes."""
        sender = asyncio.create_task(self._send())
        looker = asyncio.create_task(self._look_for_ends())
        try:
            await self._receive()
        finally:
            for task in (sender, looker, *self._asked):
                task.cancel()
            for watching in self._pictures.values():
                watching.feed.close()
            for feed in self._messages.values():
                feed.close()

    # In

    async def _receive(self) -> None:
        async for message in self._socket:
            if message.type != WSMsgType.TEXT:
                await self._refuse("texts only, please")
                return
            asked: Watch | Unwatch | Shown | Set | Dump | Malformed
            try:
                asked = request_of(message.data)
            except Malformed as error:
                asked = error
            # Counted by what it is, not by the words in it.
            if self._quota.is_exceeded(asked, time.monotonic()):
                await self._refuse(f"at most {MAX_RATE_HZ} messages a second")
                return
            try:
                if isinstance(asked, Malformed):
                    raise asked
                self._do(asked)
            except (Malformed, VisionError) as error:
                self.tell(wire.text("error", text=str(error)))

    async def _refuse(self, why: str) -> None:
        """Close the connection, unless aiohttp has, as for a message that is too large."""
        await self._socket.close(code=WSCloseCode.POLICY_VIOLATION, message=why.encode())

    def _do(self, request: Watch | Unwatch | Shown | Set | Dump) -> None:
        if isinstance(request, Shown):
            watching = self._pictures.get(request.key)
            if watching is not None:
                watching.credit = min(AHEAD, watching.credit + 1)
                watching.feed.want()
        elif isinstance(request, Watch):
            self._watch(request)
        elif isinstance(request, Unwatch):
            self._unwatch(request.key)
        else:
            task = asyncio.create_task(self._answer(request))
            self._asked.add(task)
            task.add_done_callback(self._asked.discard)

    def _watch(self, request: Watch) -> None:
        key = request.key
        if not is_stream(key, self._watcher.system.namespace):
            raise Malformed(f"key = {key!r} is no stream; allowed: those of the list")
        if len(self._pictures) + len(self._messages) >= MAX_WATCHES and not (
            key in self._pictures or key in self._messages
        ):
            raise Malformed(f"{MAX_WATCHES} streams are watched already, which is the most allowed")
        if not kind_of(key).picture:
            if key not in self._messages:
                self._messages[key] = self._hub.listen(key, self._wake.set)
            return
        before = self._pictures.get(key)
        if before is not None and before.feed.rendition.form == request.form:
            return
        feed = self._hub.watch(key, request.form)
        feed.on_ready = self._wake.set
        self._pictures[key] = Watching(feed)
        if before is not None:  # after the new one, so that the subscription stays
            before.feed.close()
        feed.want()

    def _unwatch(self, key: str) -> None:
        watching = self._pictures.pop(key, None)
        if watching is not None:
            watching.feed.close()
        messages = self._messages.pop(key, None)
        if messages is not None:
            messages.close()

    async def _answer(self, request: Set | Dump) -> None:
        try:
            if isinstance(request, Set):
                found = await self._watcher.set(request.node, request.values)
                extra: dict[str, object] = {"revision": found.revision}
            else:
                found = await self._watcher.parameters(request.node)
                extra = {"toml": toml_file(found)}
        except ParameterRefused as refused:
            fields: dict[str, object] = {"error": refused.error, "allowed": refused.allowed}
            self.tell(wire.text("reply", id=request.id, ok=False, **fields))
        except Unanswered as error:
            words = str(error)
            self.tell(wire.text("reply", id=request.id, ok=False, error=words, allowed=None))
        else:
            self.tell(wire.text("reply", id=request.id, ok=True, node=request.node, **extra))

    # Out

    async def _send(self) -> None:
        try:
            while True:
                await self._wake.wait()
                self._wake.clear()
                more = True
                while more:
                    async with asyncio.timeout(STALLED_S):
                        more = await self._send_some()
        except (ConnectionError, TimeoutError):
            # The page is gone or takes nothing; the receiver hears of it.
            if self._request.transport is not None:
                self._request.transport.abort()

    async def _send_some(self) -> bool:
        """Send what waits: all texts, some messages, a picture of each stream."""
        sent = False
        while (text := self.outbox.take()) is not None:
            await self._socket.send_str(text)
            sent = True
        for feed in list(self._messages.values()):
            for _ in range(MESSAGES_AT_ONCE):
                message = feed.take()
                if message is None:
                    break
                await self._socket.send_str(message)
                sent = True
        await self._drain()
        for watching in list(self._pictures.values()):
            picture = watching.feed.take()
            if picture is None:
                continue
            watching.ended = False
            watching.credit -= 1
            lost = watching.feed.lost(picture)
            data = picture.to_page(time.time_ns(), skipped=watching.feed.skipped, lost=lost)
            if watching.credit > 0:
                watching.feed.want()
            await self._socket.send_bytes(data)
            await self._drain()
            sent = True
        return sent

    async def _drain(self) -> None:
        """Wait until all is sent."""
        if self._request.protocol.writing_paused:
            await self._request.writer.drain()

    async def _look_for_ends(self) -> None:
        """Say of each stream when nothing comes any more."""
        while True:
            await asyncio.sleep(ENDED_POLL_S)
            for key, watching in self._pictures.items():
                stream = watching.feed.stream
                if not watching.ended and stream.silent_s:
                    watching.ended = True
                    since_ns = stream.arrived_ns
                    self.tell(wire.text("ended", key=key, since_ns=since_ns), ("ended", key))
