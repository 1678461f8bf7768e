"""The viewer's other side: Zenoh, asked and listened to without holding up the browsers' loop."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable, Hashable
from concurrent.futures import ThreadPoolExecutor
from typing import Generic, TypeVar

import zenoh

from common.link import Link
from common.zenoh_config import plain

log = logging.getLogger("viewer")

MAX_WAITING = 4096

K = TypeVar("K", bound=Hashable)
V = TypeVar("V")


class Network:
    """Does things to a link one after the other, on a thread of its own.

    Declaring and asking may wait for a link; the loop that serves browsers must not.

    Args:
        loop: Of the browsers.
    """

    def __init__(self, loop: asyncio.AbstractEventLoop) -> None:
        self.loop = loop
        self.link: Link | None = None
        self._worker = ThreadPoolExecutor(1, thread_name_prefix="network")

    def do(self, work: Callable[[Link], None]) -> None:
        """Do something as soon as what was asked before is done; nothing without a link."""
        link = self.link
        if link is not None:
            self._worker.submit(self._guarded, work, link)

    async def ask(
        self, key: str, *, payload: bytes | None = None, timeout_s: float = 1.0
    ) -> list[zenoh.Reply]:
        """Return the replies to a query, refusals too; none without a link or an answer."""
        done: asyncio.Future[list[zenoh.Reply]] = self.loop.create_future()
        replies: list[zenoh.Reply] = []

        def finish() -> None:
            if not done.done():
                done.set_result([reply for reply in replies if not _is_timeout(reply)])

        def query(link: Link) -> None:
            handler = zenoh.handlers.Callback(
                replies.append, lambda: self._to_loop(finish), indirect=False
            )
            link.session.get(
                key,
                handler,
                payload=payload,
                encoding=None if payload is None else "application/msgpack",
                timeout=timeout_s,
                target=zenoh.QueryTarget.ALL,
                consolidation=zenoh.ConsolidationMode.NONE,
            )

        self.do(query)
        if self.link is None:
            return []
        # A session that closes forgets what was asked.
        self.loop.call_later(timeout_s + 0.5, finish)
        return await done

    def close(self) -> None:
        """Do no more; what is in work is not waited for."""
        self.link = None
        self._worker.shutdown(wait=False, cancel_futures=True)

    def _to_loop(self, call: Callable[[], None]) -> None:
        try:
            self.loop.call_soon_threadsafe(call)
        except RuntimeError:
            log.debug("an answer came after the end")

    @staticmethod
    def _guarded(work: Callable[[Link], None], link: Link) -> None:
        try:
            work(link)
        except zenoh.ZError as error:
            log.warning("Zenoh: %s", plain(error))
        except Exception:
            log.exception("something asked of Zenoh failed")


class Mailbox(Generic[K, V]):
    """Hands things from Zenoh's threads to the loop: of each key the newest, in one wake-up.

    However fast they come, the loop's queue never holds more than one entry for them.

    Args:
        loop: Where they go.
        take: Called there with each.
    """

    def __init__(self, loop: asyncio.AbstractEventLoop, take: Callable[[K, V], None]) -> None:
        self._loop = loop
        self._take = take
        self._waiting: dict[K, V] = {}
        self._woken = False

    def put(self, key: K, value: V) -> None:
        """Leave something; from any thread."""
        if key not in self._waiting and len(self._waiting) >= MAX_WAITING:
            return
        self._waiting[key] = value
        if not self._woken:
            self._woken = True
            try:
                self._loop.call_soon_threadsafe(self._empty)
            except RuntimeError:
                log.debug("something came after the end")

    def _empty(self) -> None:
        self._woken = False
        while self._waiting:
            try:
                key = next(iter(self._waiting))
                value = self._waiting.pop(key)
            except (KeyError, RuntimeError, StopIteration):
                continue  # one was just put
            self._take(key, value)


def _is_timeout(reply: zenoh.Reply) -> bool:
    return reply.err is not None and reply.err.payload.to_bytes() == b"Timeout"
