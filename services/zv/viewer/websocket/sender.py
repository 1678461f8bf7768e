"""Sends texts, messages and pictures to a page over its WebSocket, in turn."""

from __future__ import annotations

import asyncio
import struct
import time
from collections import OrderedDict, deque
from collections.abc import Hashable, Iterator
from dataclasses import dataclass

from aiohttp import web

from zv.viewer import events
from zv.viewer.discovery.network import in_slices
from zv.viewer.streams.message_stream import MessageFeed
from zv.viewer.streams.picture_stream import PictureFeed
from zv.viewer.streams.rendering import EncodedPicture
from zv.viewer.websocket.link_gauge import LinkGauge

AHEAD = 2
"""Pictures of a stream that are sent to a page before it acknowledges one with ``shown``."""

ENDED_POLL_S = 0.2
PART_BYTES = 32 << 10
"""Pictures are sent in parts of this size. Between two parts, a page on a slow link gets about as
many bytes of everything else, and sees that the connection is alive."""

MAX_TEXTS = 1000
"""Most queued texts that replace no other, such as replies. With more, the page reads nothing."""

LENGTH = struct.Struct("<I")


class Outbox:
    """The queue of texts for one page; a text replaces a queued one of the same name."""

    def __init__(self, ready: asyncio.Event) -> None:
        self._ready = ready
        self._texts: OrderedDict[Hashable, str] = OrderedDict()
        self._single = 0  # number of queued texts without a name

    def put(self, text: str, replaces: Hashable | None = None) -> None:
        """Add a text; it replaces a queued one of the same name."""
        self._single += replaces is None
        name = object() if replaces is None else replaces
        self._texts.pop(name, None)
        self._texts[name] = text
        self._ready.set()

    @property
    def full(self) -> bool:
        """Whether the page has not read for too long, so that it must be disconnected."""
        return self._single > MAX_TEXTS

    def take(self) -> str | None:
        """Return and remove the oldest text; None if there is none."""
        if not self._texts:
            return None
        name, text = self._texts.popitem(last=False)
        self._single -= type(name) is object
        return text


@dataclass(slots=True)
class WatchedPictures:
    """A stream of pictures that a page watches."""

    feed: PictureFeed
    credit: int = AHEAD  # number of pictures that may still be sent without an acknowledgement
    ended: bool = False  # whether the page was told that the stream has ended


class PageSender:
    """Sends one page its queued texts, and the messages and pictures of its feeds.

    Attributes:
        wake: Set when there is something to send.
        pictures: The streams of pictures that the page watches, by key.
        messages: The streams of messages that the page watches, by key.
    """

    def __init__(self, socket: web.WebSocketResponse, request: web.Request) -> None:
        self._socket = socket
        self._request = request
        self.wake = asyncio.Event()
        self.pictures: dict[str, WatchedPictures] = {}
        self.messages: dict[str, MessageFeed] = {}
        self._outbox = Outbox(self.wake)
        self._link = LinkGauge(time.monotonic())

    def put(self, text: str, replaces: Hashable | None = None) -> None:
        """Queue a text; a page that has not read for too long is disconnected."""
        self._outbox.put(text, replaces)
        if self._outbox.full:
            self.abort()

    async def send_queued(self) -> None:
        """Send what is queued, forever; a page whose connection is broken is disconnected."""
        try:
            while True:
                await self.wake.wait()
                self.wake.clear()
                more = True
                while more:
                    more = await self._send_some()
                    await asyncio.sleep(0)  # if there is much to send, and the link never waits
        except ConnectionError:
            self.abort()

    async def _send_some(self) -> bool:
        """Send one picture per stream, and other things before each part; return whether any."""
        sent = await self._send_small()
        for watched in list(self.pictures.values()):
            feed = watched.feed
            picture = feed.take()
            if picture is None:
                continue
            watched.ended = False
            watched.credit -= 1
            data = picture_message(picture, time.time_ns(), feed.skipped, feed.lost)
            if watched.credit > 0:
                feed.want()
            for start in range(0, len(data), PART_BYTES):
                await self._send_one(data[start : start + PART_BYTES])
                await self._send_small()
            sent = True
        return sent

    async def _send_one(self, data: str | bytes) -> None:
        begun_s = time.monotonic()
        if isinstance(data, str):
            await self._socket.send_str(data)
        else:
            await self._socket.send_bytes(data)
        await self._request.writer.drain()
        bits_per_s = self._link.add(len(data), begun_s, time.monotonic())
        if bits_per_s is not None:
            self.put(events.text("link", bits_per_s=bits_per_s), "link")

    async def _send_small(self) -> bool:
        """Send texts and messages, about as much as a part of a picture; return whether any."""
        sent = False
        async for text in in_slices(self._take_small()):
            await self._send_one(text)
            sent = True
        return sent

    def _take_small(self) -> Iterator[str]:
        """Yield texts, then messages of each stream in turn, until they are ``PART_BYTES``.

        One message is yielded however many texts there are.
        """
        size = 0
        while size < PART_BYTES and (text := self._outbox.take()) is not None:
            size += len(text)
            yield text
        turns, due = deque(self.messages), True
        while turns and (size < PART_BYTES or due):
            key = turns.popleft()
            feed = self.messages.get(key)  # the page may have ended it meanwhile
            for message in feed.take(1) if feed else ():
                self.messages[key] = self.messages.pop(key)  # to the end of the turns
                turns.append(key)
                size, due = size + len(message), False
                yield message

    async def report_ended(self) -> None:
        """Tell the page of each stream that has ended."""
        while True:
            await asyncio.sleep(ENDED_POLL_S)
            for key, watched in self.pictures.items():
                since_ns = watched.feed.stream.ended_ns
                if not watched.ended and since_ns is not None:
                    watched.ended = True
                    self.put(events.text("ended", key=key, since_ns=since_ns), ("ended", key))

    def abort(self) -> None:
        """Disconnect the page at once."""
        if self._request.transport is not None:
            self._request.transport.abort()


def picture_message(picture: EncodedPicture, now_ns: int, skipped: int, lost: int) -> bytes:
    """Return the binary message that carries a picture, sent at ``now_ns``, ns since 1970."""
    age_ms = round(picture.age_ms(now_ns), 2)
    numbers = f',"age_ms":{age_ms},"skipped":{skipped},"lost":{lost}}}'.encode()
    header = picture.once("websocket", _constant_part) + numbers
    return b"".join((LENGTH.pack(len(header)), header, picture.payload))


def _constant_part(picture: EncodedPicture) -> bytes:
    """Return the part of the JSON header that is the same for all pages, not closed yet."""
    fields: dict[str, object] = {
        "key": picture.key,
        "mime": picture.mime,
        "header": picture.header.to_map(),
        "bytes": len(picture.payload),
        "width": picture.width,
        "height": picture.height,
    }
    if picture.values is not None:
        values = picture.values
        fields["depth"] = {"min": values.low, "max": values.high, "values": picture.packed}
    return events.to_json(fields)[:-1].encode()
