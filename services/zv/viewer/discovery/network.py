"""Zenoh calls of the viewer: declarations, queries and samples, without blocking the event loop."""

from __future__ import annotations

import asyncio
import logging
import time
from collections import OrderedDict
from collections.abc import AsyncIterator, Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from functools import partial
from typing import TypeVar

import zenoh

from zenoh_vision.health.fleet import Event
from zenoh_vision.host.wakeup import Wakeup
from zenoh_vision.transport.link import Link
from zenoh_vision.transport.query import REPLY_S, Query, Replies, send
from zenoh_vision.transport.zenoh_config import zenoh_error_text

log = logging.getLogger("viewer")

MAX_WAITING = 4096
MAX_TOKENS = 65_536
"""Limits of queued events; the second is for tokens, which come only once."""

MARGIN_S = 0.5
MOST_BYTES = 64 << 20

SLICE_S = 0.005
"""Longer work on the event loop is interrupted after this long."""

T = TypeVar("T")
Key = tuple[str, type, str]
"""A node's name, the type of an event, and the name of the parameter, if any."""


class Network:
    """Runs calls on a link one after the other, in a worker thread.

    Declarations and queries may block while a session is replaced; the event loop must not.
    """

    def __init__(self, loop: asyncio.AbstractEventLoop) -> None:
        self.loop = loop
        self.link: Link | None = None
        self._worker = ThreadPoolExecutor(1, thread_name_prefix="network")

    def do(self, work: Callable[[Link], None]) -> None:
        """Queue a call for the worker thread; it is dropped while there is no link."""
        link = self.link
        if link is not None:
            self._worker.submit(self._guarded, work, link)

    async def ask(
        self,
        key: str,
        *,
        payload: bytes | None = None,
        timeout_s: float = REPLY_S,
        most_bytes: int = MOST_BYTES,
    ) -> Replies:
        """Return the replies to a query, errors included; none, timed out, without a link."""
        none = Replies()
        none.timed_out = True
        if self.link is None:
            return none
        replies: asyncio.Future[Replies] = self.loop.create_future()

        def finish(found: Replies) -> None:
            if not replies.done():
                replies.set_result(found)

        query = Query(key, payload, timeout_s, most_bytes=most_bytes)
        self.do(lambda link: send(link.session, query, partial(self._to_loop, finish)))
        # A session that is closed meanwhile never completes its queries.
        self.loop.call_later(timeout_s + MARGIN_S, finish, none)
        return await replies

    def close(self) -> None:
        """Cancel the queued calls, without waiting for the one in progress."""
        self.link = None
        self._worker.shutdown(wait=False, cancel_futures=True)

    def _to_loop(self, call: Callable[[Replies], None], replies: Replies) -> None:
        with suppress(RuntimeError):  # the loop is closed
            self.loop.call_soon_threadsafe(call, replies)

    @staticmethod
    def _guarded(work: Callable[[Link], None], link: Link) -> None:
        try:
            work(link)
        except zenoh.ZError as error:
            log.warning("Zenoh: %s", zenoh_error_text(error))
        except Exception:
            log.exception("a call to Zenoh failed")


async def in_slices(items: Iterable[T]) -> AsyncIterator[T]:
    """Yield items, and every few milliseconds let the event loop do other things."""
    end_s = time.monotonic() + SLICE_S
    for item in items:
        yield item
        if time.monotonic() > end_s:
            await asyncio.sleep(0)
            end_s = time.monotonic() + SLICE_S


class LoopWakeup(Wakeup):
    """Makes the event loop call a function, with at most one call pending; from any thread."""

    def __init__(self, loop: asyncio.AbstractEventLoop, call: Callable[[], None]) -> None:
        super().__init__()
        self._loop = loop
        self._call = call
        self._pending = False

    def set(self) -> None:
        """Schedule the call, unless one is pending."""
        if not self._pending:
            self._pending = True
            with suppress(RuntimeError):  # the loop is closed
                self._loop.call_soon_threadsafe(self._run)

    def _run(self) -> None:
        self._pending = False
        self._call()


class Mailbox:
    """Passes events from Zenoh's threads to the event loop, keeping only the newest of each key."""

    def __init__(self, loop: asyncio.AbstractEventLoop, take: Callable[[Key, Event], None]) -> None:
        self._take = take
        self._waiting: OrderedDict[Key, Event] = OrderedDict()
        self._wake_up = LoopWakeup(loop, self._empty)

    def put(self, key: Key, value: Event) -> None:
        """Pass an event on; from any thread."""
        most = MAX_TOKENS if isinstance(value, bool) else MAX_WAITING
        if key not in self._waiting and len(self._waiting) >= most:
            return
        self._waiting[key] = value
        self._wake_up.set()

    def _empty(self) -> None:
        end_s = time.monotonic() + SLICE_S
        try:
            while self._waiting and time.monotonic() <= end_s:
                self._take(*self._waiting.popitem(last=False))
        finally:
            if self._waiting:
                self._wake_up.set()
