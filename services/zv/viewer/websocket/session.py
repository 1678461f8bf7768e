"""``/live``: handles the commands of one page over its WebSocket.

docs/viewer_reference.md describes the protocol.
"""

from __future__ import annotations

import asyncio
import logging
import re
import time
from collections.abc import Hashable

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
from zv.viewer.streams.registry import StreamRegistry
from zv.viewer.topics import is_stream, kind_of
from zv.viewer.websocket import commands
from zv.viewer.websocket.audit import ParameterAudit
from zv.viewer.websocket.commands import MalformedCommand
from zv.viewer.websocket.sender import AHEAD, PageSender, WatchedPictures

MAX_WATCHES = 32
HEARTBEAT_S = 15.0
SHOW_S = 0.1
"""The panels that a page shows change at most once in this time."""

MAX_ERROR = 200
"""Most characters of a node's refusal in the log."""

log = logging.getLogger("viewer")

ADDRESSES = re.compile(r"[0-9A-Fa-f.:, ]{1,100}")


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
        self._registry = registry
        self._monitor = monitor
        self._principal = principal
        proxied = request.headers.get("X-Forwarded-For")  # only as trustworthy as its sender
        if proxied and not ADDRESSES.fullmatch(proxied):
            proxied = shortened(proxied)  # quoted, so that it cannot look like the rest of a line
        of = f" for {proxied}" if proxied else ""
        self._who = f"{request.remote}{of}, {principal.name}"
        self._audit = audit
        self._sender = PageSender(socket, request)
        self._requests: set[asyncio.Task[None]] = set()
        self._commands = commands.CommandReader()
        wanted = request.query.get("show")
        self.shows = PANELS if wanted is None else PANELS.intersection(wanted.split(","))
        self._asked: frozenset[str] = self.shows  # the kinds in its last command ``show``
        self._asked_again = asyncio.Event()

    def send(self, text: str, replaces: Hashable | None = None) -> None:
        """Queue a text, unless it is for a panel that the page does not show.

        A page that has not read for too long is disconnected.
        """
        if panel_of(replaces) not in (None, *self.shows):
            return
        self._sender.put(text, replaces)

    async def serve(self) -> None:
        """Serve the page until it disconnects."""
        sender = self._sender
        work = self._receive(), sender.send_queued(), sender.report_ended(), self._fill_panels()
        tasks = [asyncio.create_task(each) for each in work]
        try:
            ended, _ = await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
            for task in ended:
                task.result()
        except Exception:
            sender.abort()  # the page connects again; the caller logs the error
            raise
        finally:
            for task in (*tasks, *self._requests):
                task.cancel()
            for key in (*self._sender.pictures, *self._sender.messages):
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
            watched = self._sender.pictures.get(command.key)
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
        watched = self._sender.pictures.keys() | self._sender.messages.keys()
        if key not in watched and len(watched) >= MAX_WATCHES:
            raise MalformedCommand(
                f"{MAX_WATCHES} streams are watched already, which is the maximum"
            )
        if not kind_of(key).picture:
            if key not in watched:
                self._sender.messages[key] = self._registry.messages(
                    key, self._sender.wake, len(watched)
                )
            return
        before = self._sender.pictures.get(key)
        if before is not None and before.feed.options == command.options:
            return
        feed = self._registry.pictures(key, command.options, self._sender.wake, len(watched))
        self._sender.pictures[key] = WatchedPictures(feed)
        if before is not None:  # closed only now, so that the subscription is kept
            before.feed.close()
        feed.want()

    def _unwatch(self, key: str) -> None:
        watched = self._sender.pictures.pop(key, None)
        if watched is not None:
            watched.feed.close()
        messages = self._sender.messages.pop(key, None)
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
        except Exception as error:
            log.exception("parameters of %s could not be requested", command.node)
            words = f"unexpected {type(error).__name__}: this is a bug in zv"
            fields = {"ok": False, "error": words, "allowed": None}
        self.send(events.text("reply", id=command.id, **fields))

    async def _set(self, command: commands.SetParameters) -> ParameterList:
        """Change parameters if the page may, and log it."""
        if reason := self._principal.forbidden(time.time()):
            self._audit.note_forbidden(self._who, command.node, f"not accepted: {reason}")
            raise ParameterRefused(reason, "a page opened with the address that permits control")
        node = self._monitor.system.fleet.node(command.node)
        known = {} if node is None else dict(node.parameters)
        # Without a reply, the node may have accepted, unless there is no such parameter.
        refused = not known.keys() >= command.values.keys()
        outcome = "the page was gone before an answer"
        try:
            found = await self._monitor.set(command.node, command.values, command.expected)
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

    async def _fill_panels(self) -> None:
        """Queue the current state of the kinds of text that the page newly shows.

        The lists of all nodes were queued when the page was opened. Of many commands ``show``, only
        the newest counts, since each may take some milliseconds.
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
