"""Handlers of ``/stream``, ``/snapshot`` and ``/stream_viewer``, as in ROS's web_video_server."""

from __future__ import annotations

import asyncio
import hashlib
import html
import logging
import time
from collections import Counter
from collections.abc import AsyncIterator, Callable, Iterator
from contextlib import contextmanager, suppress
from email.utils import formatdate
from urllib.parse import quote, urlencode

from aiohttp import web

from zenoh_vision.error_text import joined
from zenoh_vision.errors import PayloadError
from zv.viewer.discovery.system_state import SystemState
from zv.viewer.streams.picture_stream import PictureFeed
from zv.viewer.streams.registry import StreamRegistry
from zv.viewer.streams.rendering import (
    MAX_PIXELS,
    EncodedPicture,
    RenderOptions,
    cost,
    render_ended,
)
from zv.viewer.topics import kind_of, resolve
from zv.viewer.web_video_server.multipart import BOUNDARY, parts_for
from zv.viewer.web_video_server.query import NAMES, InvalidQuery, StreamQuery, parse_query

log = logging.getLogger("viewer")

MAX_SNAPSHOTS = 16
"""Limit of snapshots that are made or sent at once."""

NEVER_CACHED = {"Cache-Control": "no-store", "Pragma": "no-cache"}
MAX_LISTED = 20
MAX_ON_PAGE = 64
"""Most streams on the page without JavaScript, each with its newest picture."""

ENDED_POLL_S = 0.5


class MultipartResponse(web.StreamResponse):
    """A response that ends with its connection, and is not chunked although it has no length.

    Many readers of such streams are simple programs that do not support chunked encoding.
    """

    _length_check = False


class RenderBudget:
    """Limits the pixels that are rendered at once for one address, since all share the threads.

    A single picture may have more.
    """

    def __init__(self) -> None:
        self._clients: Counter[tuple[str | None, str, RenderOptions]] = Counter()
        self._pixels: dict[tuple[str | None, str, RenderOptions], int] = {}

    @contextmanager
    def share(
        self, address: str | None, key: str, options: RenderOptions
    ) -> Iterator[Callable[[int], None]]:
        """Yield a function that charges the pixels of a stream's newest picture.

        The same stream is charged once for all clients of an address. The function raises
        HTTPTooManyRequests if the pixels are too many.
        """
        name = address, key, options

        def charge(pixels: int) -> None:
            others = sum(
                each for of, each in self._pixels.items() if of[0] == address and of != name
            )
            if pixels and others and others + pixels > MAX_PIXELS:
                raise web.HTTPTooManyRequests(
                    text=f"{others} pixels are rendered for {address} already, {pixels} more are "
                    f"too many; allowed: {MAX_PIXELS}; request smaller pictures, or the original\n"
                )
            self._pixels[name] = pixels

        self._clients[name] += 1
        try:
            yield charge
        finally:
            self._clients[name] -= 1
            if not self._clients[name]:
                del self._clients[name]
                self._pixels.pop(name, None)


class WebVideoServer:
    """The handlers, which serve the streams of the registry, and list those of the system."""

    def __init__(self, registry: StreamRegistry, system: SystemState) -> None:
        self._registry = registry
        self._system = system
        self._budget = RenderBudget()
        self._sending = asyncio.Semaphore(MAX_SNAPSHOTS)

    async def stream(self, request: web.Request) -> web.StreamResponse:
        """Send a stream as multipart/x-mixed-replace until the client disconnects."""
        query, key = self._parse(request)
        options = query.options
        with self._budget.share(request.remote, key, options) as charge:
            feed = self._registry.pictures(key, options)
            try:
                if key in self._system.streams:
                    if await feed.stream.wait(self._registry.context.settings().wait):
                        charge(cost(feed.stream.newest_frame(), options))
                else:
                    with suppress(PayloadError):  # data arrives, but it is not a picture
                        if await self._registry.snapshot(key, options, charge) is None:
                            raise self._not_found(query.topic)
                return await self._send(request, feed, charge)
            finally:
                feed.close()

    async def _send(
        self, request: web.Request, feed: PictureFeed, charge: Callable[[int], None]
    ) -> web.StreamResponse:
        parts = parts_for(request.headers)
        content_type = f"multipart/x-mixed-replace;boundary={BOUNDARY}"
        response = MultipartResponse(headers={"Content-Type": content_type, **NEVER_CACHED})
        response.force_close()
        try:
            await response.prepare(request)
            await response.write(parts.begin)
            async for picture in self._pictures(feed):
                # The camera may send another size or form now.
                charge(picture.width * picture.height if picture.rendered else 0)
                await response.write(parts.part(picture))
                await request.writer.drain()
        except web.HTTPTooManyRequests as refusal:
            log.warning("/stream of %s ends: %s", feed.stream.key, (refusal.text or "").strip())
        except ConnectionError:
            if request.transport is not None:
                request.transport.abort()
        return response

    async def snapshot(self, request: web.Request) -> web.Response:
        """Send the newest picture, with its identity and age in the headers."""
        if self._sending.locked():
            raise unavailable(f"{MAX_SNAPSHOTS} snapshots are being sent, which is the maximum")
        async with self._sending:
            response = await self._snapshot(request)
            with self._registry.hold(response.content_length or 0):
                await response.prepare(request)
                await response.write_eof()
                await request.writer.drain()
            return response

    async def _snapshot(self, request: web.Request) -> web.Response:
        query, key = self._parse(request, single=True)
        try:
            with self._budget.share(request.remote, key, query.options) as charge:
                picture = await self._registry.snapshot(key, query.options, charge)
        except PayloadError as error:
            raise web.HTTPBadGateway(text=f"{key}: {error}\n") from None
        if picture is None:
            if key not in self._system.streams:
                raise self._not_found(query.topic)
            wait_s = self._registry.context.settings().wait
            raise unavailable(f"{key}: no picture arrived within {wait_s:g} s")
        return web.Response(body=picture.payload, headers=_snapshot_headers(picture))

    async def stream_viewer(self, request: web.Request) -> web.Response:
        """Send a page that shows one stream."""
        query, key = self._parse(request)
        given = {name: value for name, value in request.query.items() if name in NAMES}
        source = html.escape(f"stream?{urlencode(given, quote_via=quote)}")
        name = html.escape(query.topic)
        return _page(name, f'<img src="{source}" alt="{html.escape(key)}">')

    async def listing(self, _: web.Request) -> web.Response:
        """Send a page that lists the streams of pictures, for browsers without JavaScript."""
        found = [key for key in self._system.streams if kind_of(key).picture]
        items = []
        for key in found[:MAX_ON_PAGE]:
            name = html.escape(key.partition("/")[2])
            topic = f"topic=/{quote(key)}"
            picture = (
                f'<img src="snapshot?{topic}&amp;width=320" alt="" width="320" loading="lazy">'
            )
            items.append(f'<li><a href="stream_viewer?{topic}">{picture}<br>{name}</a></li>')
        more = len(found) - len(items)
        left = f"<p>{more} more are left out.</p>" if more else ""
        body = f"<ul>{''.join(items)}</ul>{left}" if items else "<p>No stream of pictures.</p>"
        return _page("Streams", body)

    def _parse(self, request: web.Request, *, single: bool = False) -> tuple[StreamQuery, str]:
        """Return the query of a request and the key of its stream."""
        try:
            query = parse_query(request.query, single=single)
        except InvalidQuery as error:
            raise web.HTTPBadRequest(text=f"{error}\n") from None
        key = resolve(query.topic, self._system.namespace, self._system.streams, raw=query.raw)
        if key is None:
            raise web.HTTPBadRequest(
                text=f"topic = {query.topic[:200]!r} is not allowed; allowed: a stream of pictures "
                f"such as /front/image/compressed{self._listed()}\n"
            )
        return query, key

    async def _pictures(self, feed: PictureFeed) -> AsyncIterator[EncodedPicture]:
        """Yield each newest picture, and a grey one with the time when the stream ends."""
        last: EncodedPicture | None = None
        while True:
            picture = await feed.next(ENDED_POLL_S)
            ended_ns = feed.stream.ended_ns
            if picture is not None:
                last = picture
                yield picture
            elif last is not None and ended_ns is not None and feed.options != RenderOptions():
                with suppress(PayloadError):
                    yield await self._registry.context.run(render_ended, last, ended_ns)
                last = None

    def _not_found(self, topic: str) -> web.HTTPException:
        if not self._system.connected:
            return unavailable("there is no router, so there are no streams")
        return web.HTTPNotFound(text=f"there is no stream {topic[:200]!r}{self._listed()}\n")

    def _listed(self) -> str:
        found = [key for key in self._system.streams if kind_of(key).picture]
        return f"; there are: {joined(found, MAX_LISTED)}" if found else ""


def _page(title: str, body: str) -> web.Response:
    """Return a page; title and body are HTML."""
    text = (
        '<!doctype html>\n<html lang="en">\n<head><meta charset="utf-8">'
        f'<meta name="viewport" content="width=device-width"><title>{title}</title></head>\n'
        f"<body>\n<h1>{title}</h1>\n{body}\n</body>\n</html>\n"
    )
    return web.Response(text=text, content_type="text/html", headers=NEVER_CACHED)


def _snapshot_headers(picture: EncodedPicture) -> dict[str, str]:
    header = picture.header
    tag = hashlib.sha256(picture.payload).hexdigest()[:16]
    return {
        "Content-Type": picture.mime,
        "X-Age-Ms": f"{picture.age_ms(time.time_ns()):.1f}",
        "X-Camera": header.camera,
        "X-Epoch": str(header.epoch),
        "X-Seq": str(header.seq),
        "X-Stamp-Ns": str(header.stamp_ns),
        "Last-Modified": formatdate(header.stamp_ns / 1e9, usegmt=True),
        "ETag": f'"{header.epoch}-{header.seq}-{tag}"',
        **NEVER_CACHED,
    }


def unavailable(reason: str, retry_s: int = 1) -> web.HTTPException:
    """Return a response with status 503 that asks the client to try again later."""
    headers = {"Retry-After": str(retry_s)}
    return web.HTTPServiceUnavailable(text=f"{reason}\n", headers=headers)
