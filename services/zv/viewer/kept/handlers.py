"""Handlers of ``/events``, ``/events.csv``, ``/events/NUMBER.jpg`` and ``.../recordings``."""

from __future__ import annotations

import asyncio
import csv
import io
from collections.abc import Callable, Mapping
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Final, TypeVar

from aiohttp import web

from zv.viewer import events
from zv.viewer.kept.recordings import recordings_of
from zv.viewer.kept.store import COLUMNS, EventStore, EventsUnavailable, Wanted

MOST: Final = 1000
USUAL: Final = 100
LONGEST: Final = 100
TEXTS: Final = ("camera", "kind", "zone")
NUMBERS: Final = ("since_ns", "until_ns", "before", "after")
FORMULA: Final = ("=", "+", "-", "@", "\t", "\r")
"""Beginnings of texts that spreadsheets take for formulas; events come from anyone."""

T = TypeVar("T")


class KeptEvents:
    """The handlers, which read a store; None if no events are kept.

    ``recordings`` is the folder of the recordings; None if they are not looked for.
    """

    def __init__(self, store: EventStore | None, recordings: Path | None = None) -> None:
        self._store = store
        self._recordings = recordings
        self._reading = asyncio.Semaphore(2)

    async def listing(self, request: web.Request) -> web.Response:
        """Send the newest events that a request wants as JSON, newest first.

        ``kept`` is false if none are kept, since a browser logs each 404 as an error.
        """
        store = self._store
        if store is None:
            return _json({"kept": False, "fault": "", "events": []})
        wanted = _wanted(request.query)
        most = _number("most", request.query, MOST) or USUAL
        found = await self._read(lambda: store.find(wanted, most))
        answer = {"kept": True, "fault": store.fault, "events": found}
        if wanted.before is None and wanted.after is None:
            answer["choices"] = await self._read(store.choices)
        return _json(answer)

    async def table(self, request: web.Request) -> web.StreamResponse:
        """Send all events that a request wants as CSV, newest first."""
        store, wanted = self._open(), _wanted(request.query)

        async def older(before: int | None) -> list[dict[str, Any]]:
            following = replace(wanted, before=before)
            return await self._read(lambda: store.find(following, MOST))

        found = await older(wanted.before)
        response = web.StreamResponse(
            headers={
                "Content-Type": "text/csv; charset=utf-8",
                "Content-Disposition": 'attachment; filename="events.csv"',
                "Cache-Control": "no-store",
            }
        )
        await response.prepare(request)
        await response.write(_rows([["time", *COLUMNS]]))
        while found:
            await response.write(_rows([_time(each), *each.values()] for each in found))
            found = await older(found[-1]["number"])
        return response

    async def picture(self, request: web.Request) -> web.Response:
        """Send a picture."""
        store, number = self._open(), int(request.match_info["number"])
        jpeg = await self._read(lambda: store.picture(number))
        if jpeg is None:
            raise web.HTTPNotFound(text="there is no such picture, or no longer\n")
        return web.Response(
            body=jpeg, content_type="image/jpeg", headers={"Cache-Control": "private, max-age=3600"}
        )

    async def recordings(self, request: web.Request) -> web.Response:
        """Send which recordings hold an event, and the commands that show them."""
        store, number = self._open(), int(request.match_info["number"])
        moment = await self._read(lambda: store.moment(number))
        if moment is None:
            raise web.HTTPNotFound(text="there is no such event, or no longer\n")
        folder, found = self._recordings, []
        if folder is not None:
            found = await self._read(lambda: recordings_of(folder, *moment))
        return _json({"recordings": found})

    def _open(self) -> EventStore:
        if self._store is None:
            raise web.HTTPNotFound(text="no events are kept; --events-dir DIR keeps them\n")
        return self._store

    async def _read(self, read: Callable[[], T]) -> T:
        try:
            async with self._reading:
                return await asyncio.to_thread(read)
        except EventsUnavailable as error:
            raise web.HTTPServiceUnavailable(text=f"{error}\n") from None


def _wanted(given: Mapping[str, str]) -> Wanted:
    texts = {name: given[name][:LONGEST] for name in TEXTS if given.get(name)}
    numbers = {name: _number(name, given, 2**63 - 1) for name in NUMBERS}
    return Wanted(**texts, **numbers)  # type: ignore[arg-type]


def _number(name: str, given: Mapping[str, str], most: int) -> int | None:
    text = given.get(name, "")
    if not text:
        return None
    if not (text.isascii() and text.isdecimal() and len(text) < 20 and 1 <= int(text) <= most):
        raise web.HTTPBadRequest(
            text=f"{name} = {text[:40]!r} is not allowed; allowed: a whole number, 1 to {most}\n"
        )
    return int(text)


def _json(fields: Mapping[str, object]) -> web.Response:
    headers = {"Cache-Control": "no-store"}
    text = events.to_json(fields)
    return web.Response(text=text, content_type="application/json", headers=headers)


def _rows(rows: Any) -> bytes:
    text = io.StringIO(newline="")
    csv.writer(text).writerows(map(_cell, row) for row in rows)
    return text.getvalue().encode()


def _cell(value: object) -> object:
    return f"'{value}" if isinstance(value, str) and value.startswith(FORMULA) else value


def _time(event: Mapping[str, Any]) -> str:
    try:
        return datetime.fromtimestamp(event["stamp_ns"] / 1e9, UTC).isoformat(
            timespec="milliseconds"
        )
    except (ValueError, OverflowError, OSError):
        return ""
