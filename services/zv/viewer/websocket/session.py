"""``/live``: the session of one page's WebSocket. docs/viewer.md describes the protocol."""

from __future__ import annotations

import asyncio
import re
import struct
import time
from collections import OrderedDict, deque
from collections.abc import Hashable, Iterator
from dataclasses import dataclass

from aiohttp import WSCloseCode, web

from zenoh_vision.config.constraints import toml_file
from zenoh_vision.error_text import shortened
from zenoh_vision.errors import ParameterRefused, VisionError
from zenoh_vision.messages import ParameterList
from zv.viewer import events
from zv.viewer.credentials import Principal
from zv.viewer.discovery.monitor import SystemMonitor, Unanswered
from zv.viewer.discovery.network import in_slices
from zv.viewer.discovery.system_state import PANELS, panel_of
from zv.viewer.streams.message_stream import MessageFeed
from zv.viewer.streams.picture_stream import PictureFeed
from zv.viewer.streams.registry import StreamRegistry
from zv.viewer.streams.rendering import EncodedPicture
from zv.viewer.topics import is_stream, kind_of
from zv.viewer.websocket import commands
from zv.viewer.websocket.audit import ParameterAudit
from zv.viewer.websocket.commands import MalformedCommand
from zv.viewer.websocket.link_gauge import LinkGauge

MAX_WATCHES = 32
AHEAD = 2
"""Pictures of a stream that are sent to a page before it acknowledges one with ``shown``."""

HEARTBEAT_S = 15.0
ENDED_POLL_S = 0.2
SHOW_S = 0.1
"""The panels that a page shows change at most once in this time."""

PART_BYTES = 32 << 10
"""Pictures are sent in parts of this size. Between two, a page on a slow link gets about as much of
everything else, and sees that the connection is alive."""

MAX_TEXTS = 1000
"""Texts that replace no other, such as replies; a page that lets more wait reads nothing."""

MAX_ERROR = 200
"""Characters of a node's refusal that the log repeats."""

ADDRESSES = re.compile(r"[0-9A-Fa-f.:, ]{1,100}")
LENGTH = struct.Struct("<I")


class Outbox:
    """The queue of texts for one page; a text replaces a queued one of the same name."""

    def __init__(self, ready: asyncio.Event) -> None:
        self._ready = ready
        self._texts: OrderedDict[Hashable, str] = OrderedDict()
        self._single = 0  # number of texts that replace no other

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


class WebSocketSession:
    """Serves one page: reads its commands, sends texts, messages and pictures."""

    def __init__(
        self,
        socket: web.WebSocketResponse,
        request: web.Request,
        registry: StreamRegistry,
        monitor: SystemMonitor,
        principal: Principal,
        audit: ParameterAudit,
    ) -> None:
        self._socket = socket
        self._request = request
        self._registry = registry
        self._monitor = monitor
        self._principal = principal
        proxied = request.headers.get("X-Forwarded-For")  # as true as whoever sent it
        if proxied and not ADDRESSES.fullmatch(proxied):
            proxied = shortened(proxied)  # quoted, so that it cannot look like the rest of a line
        of = f" for {proxied}" if proxied else ""
        self._who = f"{request.remote}{of}, {principal.name}"
        self._audit = audit
        self._wake = asyncio.Event()
        self._outbox = Outbox(self._wake)
        self._pictures: dict[str, WatchedPictures] = {}
        self._messages: dict[str, MessageFeed] = {}
        self._requests: set[asyncio.Task[None]] = set()
        self._commands = commands.CommandReader()
        self._link = LinkGauge(time.monotonic())
        wanted = request.query.get("show")
        self.shows = PANELS if wanted is None else PANELS.intersection(wanted.split(","))
        self._asked: frozenset[str] = self.shows  # what it asked to be shown last
        self._asked_again = asyncio.Event()

    def send(self, text: str, replaces: Hashable | None = None) -> None:
        """Queue a text if it is for something that the page shows.

        A page that has not read for too long is disconnected.
        """
        if panel_of(replaces) not in (None, *self.shows):
            return
        self._outbox.put(text, replaces)
        if self._outbox.full:
            self._abort()

    async def serve(self) -> None:
        """Serve the page until it disconnects."""
        work = self._send_queued(), self._report_ended(), self._fill_panels()
        tasks = [asyncio.create_task(each) for each in work]
        try:
            await self._receive()
        finally:
            for task in (*tasks, *self._requests):
                task.cancel()
            for key in (*self._pictures, *self._messages):
                self._unwatch(key)

    # From the page

    async def _receive(self) -> None:
        async for message in self._socket:
            try:
                self._run(self._commands.read(message.data, time.monotonic()))
            except commands.PolicyViolation as error:
                # Does nothing if aiohttp has closed it, as after a message that is too large.
                code = WSCloseCode.POLICY_VIOLATION
                await self._socket.close(code=code, message=str(error).encode())
                return
            except MalformedCommand as error:
                self.send(events.text("error", text=str(error)))

    def _run(self, command: commands.AnyCommand) -> None:
        if isinstance(command, commands.Shown):
            watched = self._pictures.get(command.key)
            if watched is not None:
                watched.credit = min(AHEAD, watched.credit + 1)
                watched.feed.want()
        elif isinstance(command, commands.Watch):
            try:
                self._watch(command)
            except (MalformedCommand, VisionError) as error:
                text = f"{command.key} is not watched: {error}"
                self.send(events.text("error", key=command.key, text=text))
        elif isinstance(command, commands.Unwatch):
            self._unwatch(command.key)
        elif isinstance(command, commands.Show):
            self._asked = command.kinds
            self._asked_again.set()
        else:
            task = asyncio.create_task(self._request_parameters(command))
            self._requests.add(task)
            task.add_done_callback(self._requests.discard)

    def _watch(self, command: commands.Watch) -> None:
        key = command.key
        if not is_stream(key, self._monitor.system.namespace):
            raise MalformedCommand("it is not a stream; allowed: those of the list")
        watched = self._pictures.keys() | self._messages.keys()
        if key not in watched and len(watched) >= MAX_WATCHES:
            raise MalformedCommand(
                f"{MAX_WATCHES} streams are watched already, which is the maximum"
            )
        if not kind_of(key).picture:
            if key not in watched:
                self._messages[key] = self._registry.messages(key, self._wake, len(watched))
            return
        before = self._pictures.get(key)
        if before is not None and before.feed.options == command.options:
            return
        feed = self._registry.pictures(key, command.options, self._wake, len(watched))
        self._pictures[key] = WatchedPictures(feed)
        if before is not None:  # closed only now, so that the subscription is kept
            before.feed.close()
        feed.want()

    def _unwatch(self, key: str) -> None:
        watched = self._pictures.pop(key, None)
        if watched is not None:
            watched.feed.close()
        messages = self._messages.pop(key, None)
        if messages is not None:
            messages.close()

    async def _request_parameters(
        self, command: commands.SetParameters | commands.DumpParameters
    ) -> None:
        fields: dict[str, object]
        try:
            if isinstance(command, commands.SetParameters):
                found = await self._set(command)
                fields = {"ok": True, "node": command.node, "revision": found.revision}
            else:
                found = await self._monitor.parameters(command.node)
                fields = {"ok": True, "node": command.node, "toml": toml_file(found)}
        except ParameterRefused as refused:
            fields = {"ok": False, "error": refused.error, "allowed": refused.allowed}
        except Unanswered as error:
            fields = {"ok": False, "error": str(error), "allowed": None}
        self.send(events.text("reply", id=command.id, **fields))

    async def _set(self, command: commands.SetParameters) -> ParameterList:
        """Change parameters if the page may, and log who did so."""
        if reason := self._principal.forbidden(time.time()):
            self._audit.note_forbidden(self._who, command.node, f"not accepted: {reason}")
            raise ParameterRefused(reason, "a page opened with the address that permits control")
        node = self._monitor.system.fleet.node(command.node)
        known = {} if node is None else dict(node.parameters)
        # Without an answer, the node may have accepted, unless there is no such parameter.
        refused = not known.keys() >= command.values.keys()
        outcome = "the page was gone before an answer"
        try:
            found = await self._monitor.set(command.node, command.values)
            refused, outcome = False, f"accepted (revision {found.revision})"
            return found
        except (ParameterRefused, Unanswered) as error:
            refused = refused or isinstance(error, ParameterRefused)
            outcome = f"not accepted: {str(error)[:MAX_ERROR]}"
            raise
        finally:
            self._audit.note(
                self._who, command.node, known, command.values, outcome, refused=refused
            )

    # To the page

    async def _send_queued(self) -> None:
        try:
            while True:
                await self._wake.wait()
                self._wake.clear()
                more = True
                while more:
                    more = await self._send_some()
                    await asyncio.sleep(0)  # there may be much, and the link may never wait
        except ConnectionError:
            self._abort()

    async def _fill_panels(self) -> None:
        """Queue all that there is of what the page shows and did not before.

        What is not of single nodes has been queued when the page was opened. The newest of many
        commands ``show`` counts: each may cost some milliseconds.
        """
        system, new = self._monitor.system, self.shows
        while True:
            async for text, replaces in in_slices(system.details(new)):
                self.send(text, replaces)
            await asyncio.sleep(SHOW_S)
            await self._asked_again.wait()
            self._asked_again.clear()
            new, self.shows = self._asked - self.shows, self._asked
            for text, replaces in system.overview(new, new=False):
                self.send(text, replaces)

    async def _send_some(self) -> bool:
        """Send one picture per stream, and other things before each part; return whether any."""
        sent = await self._send_small()
        for watched in list(self._pictures.values()):
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
            self.send(events.text("link", bits_per_s=bits_per_s), "link")

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
        turns, due = deque(self._messages), True
        while turns and (size < PART_BYTES or due):
            key = turns.popleft()
            feed = self._messages.get(key)  # the page may have ended it meanwhile
            for message in feed.take(1) if feed else ():
                self._messages[key] = self._messages.pop(key)  # its next turn is after the others'
                turns.append(key)
                size, due = size + len(message), False
                yield message

    async def _report_ended(self) -> None:
        """Tell the page of each stream that has ended."""
        while True:
            await asyncio.sleep(ENDED_POLL_S)
            for key, watched in self._pictures.items():
                since_ns = watched.feed.stream.ended_ns
                if not watched.ended and since_ns is not None:
                    watched.ended = True
                    self.send(events.text("ended", key=key, since_ns=since_ns), ("ended", key))

    def _abort(self) -> None:
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
    fields = {
        "key": picture.key,
        "mime": picture.mime,
        "header": picture.header.to_map(),
        "bytes": len(picture.payload),
        "width": picture.width,
        "height": picture.height,
    }
    return events.to_json(fields)[:-1].encode()
