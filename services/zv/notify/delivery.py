"""Delivers notices to their receivers, in order, again until it works or they are too old.

All receivers run on one event loop, on a thread of its own: a receiver that hangs delays neither
the others nor the node.
"""

from __future__ import annotations

import asyncio
import logging
import threading
import time
from collections.abc import Awaitable, Callable, Sequence
from contextlib import suppress
from functools import partial
from typing import Final, Protocol, Self

from zenoh_vision.error_text import without_password
from zv.notify.notice import Notice

log = logging.getLogger("notify")

MOST_WAITING: Final = 100
"""Notices that wait for one receiver; when there are more, the oldest is given up."""

FIRST_DELAY_S: Final = 1.0
LONGEST_DELAY_S: Final = 30.0
KEEP_S: Final = 10.0
"""Time between two looks at the connection to a receiver that gets no notices."""

STOP_S: Final = 1.0


class NotTaken(Exception):
    """A receiver did not take a notice; it may take it later."""


class Refused(Exception):
    """A receiver will never take a notice."""


class Receiver(Protocol):
    """Where notices go.

    Attributes:
        shows_state: It shows what is so now: it is connected all the time, and gets notices that
            are not announced, too.
    """

    name: str
    shows_state: bool

    async def keep(self) -> None:
        """Be connected; called only if it shows the state.

        Raises:
            NotTaken: It cannot be reached.
        """

    async def send(self, notice: Notice) -> None:
        """Send a notice; return once the receiver has taken it.

        Raises:
            NotTaken: It may take it later.
            Refused: It will not.
        """

    async def close(self) -> None:
        """Disconnect."""


class Delivery:
    """Sends notices to receivers within the ``with`` block.

    Args:
        receivers: Each gets every notice.
        keep_trying_s: Returns how old a notice may become.
        lost: Called for each notice that a receiver did not get; from another thread.
    """

    def __init__(
        self,
        receivers: Sequence[Receiver],
        keep_trying_s: Callable[[], float],
        lost: Callable[[], None],
    ) -> None:
        self._receivers = receivers
        self._keep_trying_s = keep_trying_s
        self._lost = lost
        self._queues: list[asyncio.Queue[tuple[float, Notice]]] = []
        self._faults: dict[str, str] = {}
        self._loop = asyncio.new_event_loop()
        self._ready = threading.Event()
        self._thread = threading.Thread(target=self._run, name="delivery", daemon=True)

    def __enter__(self) -> Self:
        self._thread.start()
        self._ready.wait()
        return self

    def __exit__(self, *_: object) -> None:
        """Give up what waits, and disconnect, in bounded time."""
        self._loop.call_soon_threadsafe(self._stop.set)
        self._thread.join(2 * STOP_S)

    @property
    def fault(self) -> str:
        """Why notices wait; empty if none does. From any thread."""
        return "; ".join(f"{name}: {why}" for name, why in sorted(dict(self._faults).items()))

    def put(self, notice: Notice) -> None:
        """Send a notice to each receiver; returns at once. From any thread."""
        self._loop.call_soon_threadsafe(self._put, time.monotonic(), notice)

    def _put(self, at_s: float, notice: Notice) -> None:
        for receiver, queue in zip(self._receivers, self._queues, strict=True):
            if not notice.announced and not receiver.shows_state:
                continue
            if queue.full():
                _, oldest = queue.get_nowait()
                why = f"{MOST_WAITING} events wait for it"
                self._faults.setdefault(receiver.name, why)
                self._give_up(receiver, oldest, why)
            queue.put_nowait((at_s, notice))

    def _run(self) -> None:
        asyncio.set_event_loop(self._loop)
        self._loop.run_until_complete(self._serve())
        self._loop.close()

    async def _serve(self) -> None:
        self._stop = asyncio.Event()
        self._queues = [asyncio.Queue(MOST_WAITING) for _ in self._receivers]
        pairs = zip(self._receivers, self._queues, strict=True)
        tasks = [asyncio.create_task(self._deliver(*pair)) for pair in pairs]
        self._ready.set()
        await self._stop.wait()
        for task in tasks:
            task.cancel()
        await asyncio.wait([asyncio.create_task(self._close(tasks))], timeout=STOP_S)

    async def _close(self, tasks: Sequence[asyncio.Task[None]]) -> None:
        # One after the other: a request whose connection is closed fails, and does not end.
        await asyncio.gather(*tasks, return_exceptions=True)
        closing = [receiver.close() for receiver in self._receivers]
        await asyncio.gather(*closing, return_exceptions=True)

    async def _deliver(
        self, receiver: Receiver, queue: asyncio.Queue[tuple[float, Notice]]
    ) -> None:
        in_work = 0
        try:
            await self._keep(receiver)
            while True:
                at_s, notice = await self._next(receiver, queue)
                in_work = 1
                await self._send(receiver, at_s, notice)
                in_work = 0
                self._end_if_stopped()
        finally:
            if waiting := queue.qsize() + in_work:
                log.warning("%s has not taken the last %d events", receiver.name, waiting)

    def _end_if_stopped(self) -> None:
        """Raise CancelledError again where a library lost it, as wait_for of Python 3.11 may."""
        if self._stop.is_set():
            raise asyncio.CancelledError

    async def _next(
        self, receiver: Receiver, queue: asyncio.Queue[tuple[float, Notice]]
    ) -> tuple[float, Notice]:
        """Return the next notice, and keep the connection until there is one."""
        while True:
            with suppress(TimeoutError):
                return await asyncio.wait_for(queue.get(), KEEP_S)
            await self._keep(receiver)

    async def _keep(self, receiver: Receiver) -> None:
        if receiver.shows_state:
            await self._attempt(receiver, receiver.keep)

    async def _send(self, receiver: Receiver, at_s: float, notice: Notice) -> None:
        """Send a notice until it is taken, refused or too old."""
        delay_s = FIRST_DELAY_S
        while True:
            try:
                if await self._attempt(receiver, partial(receiver.send, notice)):
                    return
            except Refused as error:
                self._give_up(receiver, notice, str(error))
                return
            self._end_if_stopped()
            if time.monotonic() - at_s + delay_s > self._keep_trying_s():
                self._give_up(receiver, notice, "it is too old")
                return
            await asyncio.sleep(delay_s)
            delay_s = min(2 * delay_s, LONGEST_DELAY_S)

    async def _attempt(self, receiver: Receiver, act: Callable[[], Awaitable[None]]) -> bool:
        """Return whether a receiver can be used so; note why not.

        Raises:
            Refused: As for ``Receiver.send``.
        """
        try:
            await act()
        except Refused:
            raise
        except Exception as error:
            # A library's own error, as of a host that no name server takes, ends no task.
            known = isinstance(error, NotTaken)
            why = without_password(str(error) if known else f"{type(error).__name__}: {error}")
            if receiver.name not in self._faults:
                log.warning("%s does not take events: %s", receiver.name, why)
            self._faults[receiver.name] = why
            return False
        self._faults.pop(receiver.name, None)
        return True

    def _give_up(self, receiver: Receiver, notice: Notice, why: str) -> None:
        log.warning("%s did not get %s: %s", receiver.name, notice.id, without_password(why))
        self._lost()
