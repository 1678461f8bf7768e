"""``/stream``, ``/snapshot`` and ``/stream_viewer``: the URLs that web_video_server has."""

from __future__ import annotations

import asyncio
import hashlib
import html
import time
from collections.abc import AsyncIterator
from contextlib import suppress
from dataclasses import replace
from email.utils import formatdate
from urllib.parse import quote, urlencode

from aiohttp import web

from common.errors import PayloadError
from services.viewer.hub import Hub, TooMany
from services.viewer.latest import Latest
from services.viewer.multipart import BOUNDARY, Parts, parts_for
from services.viewer.queries import NAMES, BadQuery, StreamQuery, stream_query
from services.viewer.rendering import Form, ended
from services.viewer.renditions import Feed
from services.viewer.system import System
from services.viewer.topics import kind_of, meant
from services.viewer.wire import Picture

STALLED_S = 20.0
"""A client that takes nothing for so long is left."""

NEVER_CACHED = {"Cache-Control": "no-store", "Pragma": "no-cache"}
MOST_LISTED = 20
ENDED_POLL_S = 0.5


class Multipart(web.StreamResponse):
    """An answer that ends with its connection, and is not cut into chunks until then.

    Readers of such streams are often a few lines that know nothing of chunks.
    """

    _length_check = False


class Compatible:
    """The handlers.

    Args:
        hub: The streams.
        system: What is known of them.
        latest: Finds single pictures.
    """

    def __init__(self, hub: Hub, system: System, latest: Latest) -> None:
        self._hub = hub
        self._system = system
        self._latest = latest

    async def stream(self, request: web.Request) -> web.StreamResponse:
        """Send a stream as multipart/x-mixed-replace for as long as the client takes it."""
        query, key = self._asked(request)
        if key not in self._system.streams and not await self._comes(key, query):
            raise self._unknown(query.topic)
        feed = self._watch(key, query)
        parts = parts_for(request.headers)
        response = Multipart(
            headers={
                "Content-Type": f"multipart/x-mixed-replace;boundary={BOUNDARY}",
                **NEVER_CACHED,
            }
        )
        response.force_close()
        try:
            await response.prepare(request)
            await response.write(parts.begin())
            async for data in self._sent(feed, parts):
                async with asyncio.timeout(STALLED_S):  # what is large waits in `write` already
                    await response.write(data)
                    await request.writer.drain()
        except (ConnectionError, TimeoutError):
            if request.transport is not None:
                request.transport.abort()
        finally:
            feed.close()
        return response

    async def snapshot(self, request: web.Request) -> web.Response:
        """Send the newest picture, with its identity and age as headers."""
        query, key = self._asked(request, one=True)
        try:
            picture = await self._latest.picture(key, query.form)
        except PayloadError as error:
            raise web.HTTPBadGateway(text=f"{key}: {error}\n") from None
        except TooMany as error:
            raise _busy(str(error)) from None
        if picture is None:
            if key not in self._system.streams:
                raise self._unknown(query.topic)
            raise _busy(f"{key}: no picture came within {self._hub.options().wait:g} s")
        return web.Response(body=picture.payload, headers=identity(picture))

    async def stream_viewer(self, request: web.Request) -> web.Response:
        """Send a page with one stream in it."""
        query, key = self._asked(request)
        given = {name: value for name, value in request.query.items() if name in (*NAMES, "token")}
        source = html.escape(f"stream?{urlencode(given, quote_via=quote)}")
        name = html.escape(query.topic)
        text = (
            f'<!doctype html>\n<html lang="en">\n<head><meta charset="utf-8">'
            f"<title>{name}</title></head>\n<body>\n<h1>{name}</h1>\n"
            f'<img src="{source}" alt="{html.escape(key)}">\n</body>\n</html>\n'
        )
        return web.Response(text=text, content_type="text/html", headers=NEVER_CACHED)

    def _asked(self, request: web.Request, *, one: bool = False) -> tuple[StreamQuery, str]:
        try:
            query = stream_query(request.query, one=one)
        except BadQuery as error:
            raise web.HTTPBadRequest(text=f"{error}\n") from None
        known = self._system.streams
        key = meant(query.topic, self._system.namespace, known, raw=query.raw)
        if key is None:
            raise web.HTTPBadRequest(
                text=f"topic = {query.topic[:200]!r} is not allowed; allowed: a stream of pictures "
                f"such as /front/image/compressed{self._listed()}\n"
            )
        return query, key

    async def _comes(self, key: str, query: StreamQuery) -> bool:
        """Tell whether pictures come on a key that no node describes."""
        try:
            return await self._latest.picture(key, query.form) is not None
        except TooMany as error:
            raise _busy(str(error)) from None
        except PayloadError:
            return True

    async def _sent(self, feed: Feed, parts: Parts) -> AsyncIterator[bytes]:
        """Yield the newest picture again and again; when the stream ends, one that says so."""
        last: Picture | None = None
        while True:
            picture = await feed.next(ENDED_POLL_S)
            if picture is not None:
                last = picture
                yield parts.part(picture)
            elif last is not None and feed.stream.silent_s and feed.rendition.form != Form():
                since_ns = feed.stream.arrived_ns
                picture, last = last, None
                with suppress(PayloadError):
                    payload = await self._hub.loop.run_in_executor(
                        self._hub.pool, ended, picture.payload, since_ns
                    )
                    fresh = replace(picture, payload=payload, part=b"", browser_part=b"")
                    yield parts.part(replace(fresh, ended_ns=since_ns))

    def _watch(self, key: str, query: StreamQuery) -> Feed:
        try:
            return self._hub.watch(key, query.form)
        except TooMany as error:
            raise _busy(str(error)) from None

    def _unknown(self, topic: str) -> web.HTTPException:
        if not self._system.connected:
            return _busy("there is no router, so there are no streams")
        return web.HTTPNotFound(text=f"there is no stream {topic[:200]!r}{self._listed()}\n")

    def _listed(self) -> str:
        found = [key for key in self._system.streams if kind_of(key).picture]
        more = f" and {len(found) - MOST_LISTED} more" if len(found) > MOST_LISTED else ""
        return f"; there are: {', '.join(found[:MOST_LISTED])}{more}" if found else ""


def identity(picture: Picture) -> dict[str, str]:
    """Return the headers that say which picture it is and how old."""
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


def _busy(reason: str) -> web.HTTPException:
    return web.HTTPServiceUnavailable(text=f"{reason}\n", headers={"Retry-After": "1"})
