"""The web application: its addresses, and what holds for all of them."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Awaitable, Callable, Hashable

from aiohttp import web

from common.description import installed_version
from services.viewer import wire
from services.viewer.access import SECURITY_HEADERS, Access, Refused, cookie_name
from services.viewer.compatible import Compatible
from services.viewer.connections import Connection
from services.viewer.hub import Hub
from services.viewer.live import HEARTBEAT_S, Page
from services.viewer.page_files import INDEX, PageFile, page_files
from services.viewer.requests import MAX_BYTES
from services.viewer.watching import Watcher

log = logging.getLogger("viewer")

Handler = Callable[[web.Request], Awaitable[web.StreamResponse]]
NO_TOKEN = ("/healthz",)
MAX_BODY_BYTES = 1024
COOKIE_S = 30 * 86400
STALLED_S = 2.0
"""A client that has taken nothing for so long gives its place to one that has none."""


class Application:
    """Everything that a browser may ask.

    Args:
        access: Who may.
        hub: The streams.
        watcher: The system.
        compatible: The handlers of streams.
        max_clients: How many pages and streams at once.
    """

    def __init__(
        self,
        access: Access,
        hub: Hub,
        watcher: Watcher,
        compatible: Compatible,
        max_clients: Callable[[], int],
    ) -> None:
        self._access = access
        self._hub = hub
        self._watcher = watcher
        self._compatible = compatible
        self._max_clients = max_clients
        self._files = page_files()
        self._pages: set[Page] = set()
        self._clients: dict[object, Connection | None] = {}
        self.app = web.Application(middlewares=[self._guard], client_max_size=MAX_BODY_BYTES)
        self.app.on_response_prepare.append(_add_headers)
        self.app.router.add_get("/", self._index)
        self.app.router.add_get("/page/{name}", self._file)
        self.app.router.add_get("/favicon.ico", self._no_icon)
        self.app.router.add_get("/healthz", self._healthy)
        self.app.router.add_get("/live", self._counted(self._live), allow_head=False)
        self.app.router.add_get("/stream", self._counted(compatible.stream), allow_head=False)
        self.app.router.add_get("/snapshot", compatible.snapshot)
        self.app.router.add_get("/stream_viewer", compatible.stream_viewer)

    def tell_all(self, text: str, replaces: Hashable | None = None) -> None:
        """Send a text to all pages."""
        for page in self._pages:
            page.tell(text, replaces)

    # Before each request

    @web.middleware
    async def _guard(self, request: web.Request, handler: Handler) -> web.StreamResponse:
        """Let in who may ask, and mark the connection as busy meanwhile."""
        connection = _connection(request)
        if connection is not None:
            connection.begin()
        try:
            self._check(request)
            return await handler(request)
        except Refused as refused:
            response = web.Response(status=refused.status, text=f"{refused.reason}\n")
            if refused.status == web.HTTPUnauthorized.status_code:
                response.headers["WWW-Authenticate"] = "Bearer"
            response.force_close()
            return response
        except web.HTTPException as error:
            return web.Response(status=error.status, text=error.text, headers=_kept(error.headers))
        except (OSError, asyncio.CancelledError):
            raise  # the client is gone
        except Exception as error:
            log.exception("%s could not be answered", request.path[:100])
            words = f"unexpected {type(error).__name__}: this is a fault in zv\n"
            return web.Response(status=500, text=words)
        finally:
            if connection is not None:
                connection.finish()

    def _check(self, request: web.Request) -> None:
        host, origin = request.headers.get("Host"), request.headers.get("Origin")
        self._access.check_host(host)
        upgrade = "Upgrade" in request.headers
        if upgrade or request.method not in ("GET", "HEAD"):
            self._access.check_origin(origin, host)
        if request.path not in NO_TOKEN:
            self._access.check_token(
                {
                    "query": request.query.get("token"),
                    "cookie": request.cookies.get(cookie_name(host)),
                    "bearer": _bearer(request.headers.get("Authorization")),
                }
            )

    def _counted(self, handler: Handler) -> Handler:
        """Return a handler that refuses when as many are served as may be."""

        async def serve(request: web.Request) -> web.StreamResponse:
            most = self._max_clients()
            if len(self._clients) >= most and not self._make_room():
                raise web.HTTPServiceUnavailable(
                    text=f"{most} clients are served already, which is the most allowed "
                    "(--max-clients)\n",
                    headers={"Retry-After": "5"},
                )
            client = object()
            self._clients[client] = _connection(request)
            try:
                return await handler(request)
            finally:
                self._clients.pop(client, None)

        return serve

    def _make_room(self) -> bool:
        """Leave the client that has taken nothing for longest; return whether there is one."""
        stalled_s = {
            client: connection.stalled_s
            for client, connection in self._clients.items()
            if connection is not None
        }
        slowest = max(stalled_s, key=lambda client: stalled_s[client], default=None)
        if slowest is None or stalled_s[slowest] < STALLED_S:
            return False
        connection = self._clients.pop(slowest)
        if connection is not None:
            connection.abort()
        return True

    # Handlers

    async def _index(self, request: web.Request) -> web.Response:
        response = _served(self._files[INDEX])
        token = request.query.get("token")
        if self._access.knows(token):
            name = cookie_name(request.headers.get("Host"))
            response.set_cookie(
                name, str(token), max_age=COOKIE_S, httponly=True, samesite="Strict", path="/"
            )
        return response

    async def _file(self, request: web.Request) -> web.Response:
        file = self._files.get(request.match_info["name"])
        if file is None:
            raise web.HTTPNotFound(text="there is no such file\n")
        if request.headers.get("If-None-Match") == file.tag:
            return web.Response(status=304, headers={"ETag": file.tag})
        return _served(file)

    async def _no_icon(self, _: web.Request) -> web.Response:
        return web.Response(status=204)

    async def _healthy(self, _: web.Request) -> web.Response:
        return web.Response(text="ok\n")

    async def _live(self, request: web.Request) -> web.StreamResponse:
        socket = web.WebSocketResponse(
            heartbeat=HEARTBEAT_S,
            compress=False,
            max_msg_size=MAX_BYTES + 1,  # aiohttp refuses what is as large as this
            timeout=1.0,
        )
        if not socket.can_prepare(request):
            raise web.HTTPBadRequest(text="/live is a WebSocket\n")
        await socket.prepare(request)
        page = Page(socket, request, self._hub, self._watcher)
        namespace = self._watcher.system.namespace
        page.tell(
            wire.text(
                "hello",
                version=installed_version(),
                namespace=namespace,
                server="viewer",
                now_ns=wire.now_ns(),
            )
        )
        for text in self._watcher.system.everything():
            page.tell(text)
        self._pages.add(page)
        self._watcher.pages += 1
        try:
            await page.serve()
        finally:
            self._pages.discard(page)
            self._watcher.pages -= 1
        return socket


async def _add_headers(_: web.Request, response: web.StreamResponse) -> None:
    for name, value in SECURITY_HEADERS.items():
        response.headers.setdefault(name, value)
    response.headers["Server"] = "zenoh-vision"


def _connection(request: web.Request) -> Connection | None:
    transport = request.transport
    found = transport.get_protocol() if transport is not None else None
    return found if isinstance(found, Connection) else None


def _served(file: PageFile) -> web.Response:
    headers = {"Content-Type": file.type, "ETag": file.tag, "Cache-Control": "no-cache"}
    return web.Response(body=file.body, headers=headers)


def _kept(headers: object) -> dict[str, str]:
    """Return those headers of an error that are ours to give."""
    assert hasattr(headers, "items")
    kept = ("Retry-After", "Allow")
    return {name: value for name, value in headers.items() if name in kept}


def _bearer(header: str | None) -> str | None:
    kind, _, token = (header or "").partition(" ")
    return token if kind.lower() == "bearer" else None
