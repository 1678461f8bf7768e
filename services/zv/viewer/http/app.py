"""The web application: routes, access checks and the limit on clients."""

from __future__ import annotations

import logging
import time
from collections.abc import Awaitable, Callable, Hashable
from functools import partial

from aiohttp import web

from zenoh_vision.version import installed_version
from zv.viewer import events
from zv.viewer.discovery.monitor import SystemMonitor
from zv.viewer.http.access import SECURITY_HEADERS, Access
from zv.viewer.http.connections import Connection
from zv.viewer.http.static_files import INDEX, PageFile, page_files
from zv.viewer.kept.handlers import KeptEvents
from zv.viewer.streams.registry import StreamRegistry, TooManyBytes, TooManyStreams
from zv.viewer.web_video_server.handlers import WebVideoServer, unavailable
from zv.viewer.websocket.audit import ParameterAudit
from zv.viewer.websocket.commands import MAX_BYTES
from zv.viewer.websocket.session import HEARTBEAT_S, WebSocketSession

log = logging.getLogger("viewer")

Handler = Callable[[web.Request], Awaitable[web.StreamResponse]]
STALLED_S = 2.0
"""A client that has read nothing for this long may be replaced by a new one."""


class Application:
    """Everything that a browser may request."""

    def __init__(
        self,
        access: Access,
        registry: StreamRegistry,
        monitor: SystemMonitor,
        kept: KeptEvents | None = None,
    ) -> None:
        self._access = access
        self._registry = registry
        self._monitor = monitor
        self._files = page_files()
        self._sessions: set[WebSocketSession] = set()
        self._clients: set[Connection] = set()
        self._audit = ParameterAudit()
        videos = WebVideoServer(registry, monitor.system)
        self.app = web.Application(middlewares=[self._guard], client_max_size=1024)
        self.app.on_response_prepare.append(_add_headers)
        self.app.on_cleanup.append(self._flush_audit)
        for base in dict.fromkeys(("", access.base_path)):
            self._add_routes(base, videos, kept or KeptEvents(None))

    def _add_routes(self, base: str, videos: WebVideoServer, kept: KeptEvents) -> None:
        add = self.app.router.add_get
        add(f"{base}/", partial(self._opened, self._index))
        add(f"{base}/page/{{name:.+}}", self._file)
        add(f"{base}/favicon.ico", self._no_icon)
        add(f"{base}/healthz", self._healthy)
        add(f"{base}/live", partial(self._limited, self._live), allow_head=False)
        add(f"{base}/stream", partial(self._limited, videos.stream), allow_head=False)
        add(f"{base}/snapshot", videos.snapshot)
        add(f"{base}/schema", self._schema)
        add(f"{base}/events", kept.listing)
        add(f"{base}/events.csv", kept.table)
        add(f"{base}/events/{{number:[0-9]{{1,18}}}}.jpg", kept.picture)
        add(f"{base}/events/{{number:[0-9]{{1,18}}}}/recordings", kept.recordings)
        add(f"{base}/streams", partial(self._opened, videos.listing))
        add(f"{base}/stream_viewer", partial(self._opened, videos.stream_viewer))
        if base:
            add(base, self._with_slash)

    def send_all(self, text: str, replaces: Hashable | None = None) -> None:
        """Send a text to all pages; it replaces a queued one of the same name."""
        for session in self._sessions:
            session.send(text, replaces)

    def wanted(self, kind: str) -> bool:
        """Tell whether a page shows a kind of ``PANELS``."""
        return any(kind in session.shows for session in self._sessions)

    # Around each request

    @web.middleware
    async def _guard(self, request: web.Request, handler: Handler) -> web.StreamResponse:
        """Check a request, and mark its connection as busy until it is answered."""
        connection = _connection(request)
        connection.begin_request()
        try:
            self._access.check(request)
            return await handler(request)
        except (web.HTTPUnauthorized, web.HTTPForbidden) as refusal:
            refusal.force_close()
            raise
        except (TooManyStreams, TooManyBytes) as error:
            raise unavailable(str(error)) from None
        except (web.HTTPException, OSError):
            raise
        except Exception as error:
            log.exception("%s could not be answered", request.path[:100])
            words = f"unexpected {type(error).__name__}: this is a bug in zv\n"
            return web.Response(status=500, text=words)
        finally:
            connection.end_request()

    async def _limited(self, handler: Handler, request: web.Request) -> web.StreamResponse:
        """Run a handler for one more client, unless there are ``max_clients``."""
        most = self._registry.context.settings().max_clients
        if len(self._clients) >= most and not self._disconnect_slowest():
            raise unavailable(
                f"{most} clients are served already, which is the maximum (--max-clients)", 5
            )
        connection = _connection(request)
        self._clients.add(connection)
        self._registry.clients = len(self._clients)
        try:
            return await handler(request)
        finally:
            self._clients.discard(connection)
            self._registry.clients = len(self._clients)

    def _disconnect_slowest(self) -> bool:
        """Disconnect the client that has read nothing for longest; return whether there is one."""
        slowest = max(self._clients, key=lambda client: client.stalled_s)
        if slowest.stalled_s < STALLED_S:
            return False
        self._clients.discard(slowest)
        slowest.abort()
        return True

    async def _opened(self, handler: Handler, request: web.Request) -> web.StreamResponse:
        """Run a page's handler; a request with a token is redirected, with a session, instead."""
        return self._access.redirect(request) or await handler(request)

    async def _flush_audit(self, _: web.Application) -> None:
        self._audit.flush()

    # Handlers

    async def _index(self, request: web.Request) -> web.Response:
        return _file_response(request, self._files[INDEX])

    async def _with_slash(self, request: web.Request) -> web.Response:
        """Redirect to the folder, to which the page's own addresses are relative."""
        query = f"?{request.query_string}" if request.query_string else ""
        raise web.HTTPPermanentRedirect(f"{request.path.rpartition('/')[2]}/{query}")

    async def _file(self, request: web.Request) -> web.Response:
        file = self._files.get(request.match_info["name"])
        if file is None:
            raise web.HTTPNotFound(text="there is no such file\n")
        if request.headers.get("If-None-Match") == file.tag:
            return web.Response(status=304, headers={"ETag": file.tag})
        return _file_response(request, file)

    async def _schema(self, request: web.Request) -> web.Response:
        """Send the JSON Schema of a type of message, of this project or as a node answers it.

        It is null if there is none: many strangers' messages have none, and a browser logs each
        404 as an error.
        """
        text = await self._monitor.schema(request.query.get("name", ""))
        return web.Response(text=text or "null", content_type="application/json")

    async def _no_icon(self, _: web.Request) -> web.Response:
        return web.Response(status=204)

    async def _healthy(self, _: web.Request) -> web.Response:
        return web.Response(text="ok\n")

    async def _live(self, request: web.Request) -> web.StreamResponse:
        socket = web.WebSocketResponse(
            heartbeat=HEARTBEAT_S,
            compress=False,
            max_msg_size=MAX_BYTES + 1,  # aiohttp refuses messages of this size
            timeout=1.0,
        )
        if not socket.can_prepare(request):
            raise web.HTTPBadRequest(text="/live is a WebSocket\n")
        principal = self._access.principal(request)
        await socket.prepare(request)
        session = WebSocketSession(
            socket, request, self._registry, self._monitor, principal, self._audit
        )
        system = self._monitor.system
        about = {"version": installed_version(), "namespace": system.namespace, "server": "viewer"}
        scope = str(principal.scope)
        session.send(events.text("hello", **about, scope=scope, now_ns=time.time_ns()))
        for text, replaces in system.overview(session.shows):
            session.send(text, replaces)
        self._sessions.add(session)
        self._monitor.pages = len(self._sessions)
        try:
            await session.serve()
        finally:
            self._sessions.discard(session)
            self._monitor.pages = len(self._sessions)
        return socket


async def _add_headers(_: web.Request, response: web.StreamResponse) -> None:
    response.headers.update(SECURITY_HEADERS, Server="zenoh-vision")


def _connection(request: web.Request) -> Connection:
    """Return the connection of a request; ConnectionResetError if the client is gone."""
    connection = request.transport.get_protocol() if request.transport is not None else None
    if not isinstance(connection, Connection):
        raise ConnectionResetError
    return connection


def _file_response(request: web.Request, file: PageFile) -> web.Response:
    headers = {
        "Content-Type": file.type,
        "ETag": file.tag,
        "Cache-Control": "no-cache",
        "Vary": "Accept-Encoding",
    }
    accepted = request.headers.get("Accept-Encoding", "").replace(" ", "").split(",")
    if not {"gzip", "*"}.intersection(accepted):  # weights are ignored
        return web.Response(body=file.body, headers=headers)
    return web.Response(body=file.compressed, headers=headers | {"Content-Encoding": "gzip"})
